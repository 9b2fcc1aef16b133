"""A map in the formats that other tools read, in its own frame or in the grid of the mine."""

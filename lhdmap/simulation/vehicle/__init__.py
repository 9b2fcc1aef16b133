"""The machine as it moves: stepped by commands, over the floor of a world, with bodies that may touch its walls."""

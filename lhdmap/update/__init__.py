"""A map and another drive: where the drive lies in the map, both as one map, and what has changed."""

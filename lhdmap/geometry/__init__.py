"""Rigid motions in the plane (`se2`) and in space (`se3`)."""

"""Rigid motions in the plane (`se2`) and in space (`se3`, `twist`), upright frames, boxes, planes, the two bodies of a machine."""

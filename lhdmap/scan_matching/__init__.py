"""Scan matching as a service: maps of walls, matches of scans with them, wide searches; odometry, smoothing and others use it."""

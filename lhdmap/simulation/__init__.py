"""Simulated drives: a drift, the machine in it, its sensors, and the log with its truth; planar worlds for odometry."""

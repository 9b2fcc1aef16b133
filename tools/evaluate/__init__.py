"""Tables of measured figures: `python -m tools.evaluate.odometry_table`, `python -m tools.evaluate.real_logs`."""

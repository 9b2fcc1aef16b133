"""Wheels and gyroscope beside the scans: `model` puts the wheels together, `gyro` stands alone."""

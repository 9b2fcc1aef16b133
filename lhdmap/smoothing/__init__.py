"""Smoothing: key scans of the drive as a pose graph with loop closures, solved by gtsam."""

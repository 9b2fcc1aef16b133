"""Odometry of 3D scanners: `odometry` is the stage, `matchers` find poses, `planes` judge them, `motion` predicts."""

"""Docking: ways to a dock on an apron, with the joint as a state, that the tracker can follow; docs/tracking.md."""

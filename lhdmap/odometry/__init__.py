"""Scans in, motion out: range flow, the local wall map, the motion model, degeneracy; 2D and 3D scanners."""

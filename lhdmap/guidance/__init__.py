"""Guidance: commands for the next seconds that keep both bodies off the walls and on the way (Section 3.4.3)."""

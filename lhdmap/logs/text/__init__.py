"""Logs of lines of text: CARMEN (`carmen`) and BreezySLAM (`breezy`)."""

"""Closed loop: simulated time, processes on a bus, a journal and a verdict; the same perception as on a log."""

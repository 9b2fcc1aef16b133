"""Mines as plans: drifts with their centre lines, how they join, places in them, and ways through them."""

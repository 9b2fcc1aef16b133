"""The ore pile: found, measured and judged while the machine drives at it."""

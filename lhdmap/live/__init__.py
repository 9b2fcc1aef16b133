"""A running machine followed live: sources of messages, and the same stages as on a log."""

"""Range flow: scans compared in pairs, after the paper; from top to bottom `matcher`, `reference`, `flow`, `rows`, `scan`."""

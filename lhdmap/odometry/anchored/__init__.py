"""The default matcher: scans against a local map of the walls; `matcher` is the method."""

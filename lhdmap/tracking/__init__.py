"""Path tracking of both bodies: Section 2.4 of the load-haul-dump paper, corrected; docs/tracking.md has the method."""

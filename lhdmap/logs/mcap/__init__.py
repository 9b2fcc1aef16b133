"""MCAP files: `log` reads them, `scan` those without an index, `records` knows the bytes."""

"""Where a machine is on a map: tracking against its walls, global search, loss and recovery."""

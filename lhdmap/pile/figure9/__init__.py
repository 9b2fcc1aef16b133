"""The method of Fig. 9 of the autonomous-loading paper, as printed and repaired: `method` and, over a drive, `stage`."""

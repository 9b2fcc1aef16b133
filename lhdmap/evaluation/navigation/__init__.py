"""Tables 3 and 4 of the navigation paper from logs: signals, figures of a drive, walls, groups, the paper's own rows."""

"""Many logs: a manifest in, each row as a command in a process of its own, one table and one page out."""

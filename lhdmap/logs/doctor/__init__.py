"""What is wrong with a log: `health` puts the verdict together from scans, stamps and values."""

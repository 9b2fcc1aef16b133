"""What was produced, and what the time went into: records of cycles, figures, time usage, IREDES."""

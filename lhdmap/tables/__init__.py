"""Tables of numbers that other tools and people write: encodings, separators, decimal commas, columns found by their names."""

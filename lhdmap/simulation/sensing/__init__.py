"""The sensors of a simulated machine: objects that are read when they are due, and faults that wrap them."""

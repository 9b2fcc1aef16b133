"""Comparison of results with ground truth: numbers first, files and plots elsewhere."""

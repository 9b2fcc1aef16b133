"""Autonomous loading: what a machine does between the drift and a full bucket. No module in here sees a truth."""

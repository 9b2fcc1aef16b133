"""Piles in clouds that are given as they are: `heap` of any cloud, `drift` of one with the drift before it."""

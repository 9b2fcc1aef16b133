"""LIDAR-landmarks of the nodes: those of the paper with similarity matrix and keys, and the fused walls that localization uses."""

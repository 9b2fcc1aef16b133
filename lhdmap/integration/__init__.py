"""Integration of scans with known poses into one cloud: projection, self-filter, voxel grid, normals, cloud files."""

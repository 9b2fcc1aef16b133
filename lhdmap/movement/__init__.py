"""Movement over the topological map: the six states of each point, routes with inversions, whether a map is ready to run."""

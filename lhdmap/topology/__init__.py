"""The mine as a graph: tunnels, intersections, access points, waypoints and the connections between them."""

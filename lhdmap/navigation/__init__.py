"""Navigation control: from a goal on the map to directives for guidance (Sections 3.4.1 and 3.4.2 of the topological paper)."""

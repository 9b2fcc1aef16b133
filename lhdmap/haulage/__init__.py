"""Load, haul, dump: the stages of a cycle as state machines, sites, and the executive of a mission."""

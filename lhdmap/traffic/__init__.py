"""Several machines on one map: sections that one machine holds at a time, without a deadlock."""

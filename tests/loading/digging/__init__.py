"""Tests of charging, excavation, shaking, weighing and the rule for another attempt."""

"""Tests of Tables 3, 4 and 5."""

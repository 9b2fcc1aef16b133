"""`python -m lhdmap`."""

from lhdmap.cli.main import entry_point

entry_point()

"""`python -m lhdmap` is `lhdmap`."""

from lhdmap.cli.main import entry_point

if __name__ == "__main__":
    entry_point()

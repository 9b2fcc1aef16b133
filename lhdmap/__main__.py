"""`python -m lhdmap`."""

from lhdmap.cli.start import entry_point

if __name__ == "__main__":
    entry_point()

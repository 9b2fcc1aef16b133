"""lhdmap: perception and mapping for load-haul-dump machines in underground mines.

The package imports nothing heavy: `import lhdmap` stays cheap, and each command loads what it needs.
"""

__version__ = "0.1.0"

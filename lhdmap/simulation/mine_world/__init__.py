"""The surface of a mine: tubes joined to one hollow, what stands in it, and what rays, wheels and bodies meet there."""

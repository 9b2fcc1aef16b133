"""Machine and ground while loading: bucket in the pile, traction, hydraulics, a pile that is dug. The model: docs/ground.md."""

"""Machine and ground while loading: bucket in the pile, traction, hydraulics, the pile that is dug. docs/ground.md has the model."""

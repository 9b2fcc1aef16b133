"""What the machine feels of itself: attitude by the inclinometer, motion by wheels and articulation, slip."""

"""The machine that is stepped: drive, brakes, steering, boom and bucket on a floor, and the contact of its bodies."""

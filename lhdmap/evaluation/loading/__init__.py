"""Tables 3, 4 and 5 of the autonomous loading paper from logs of loadings."""

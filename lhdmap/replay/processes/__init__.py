"""The processes of a replay: simulator, perception, driver, and those who watch and write."""

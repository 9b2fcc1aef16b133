"""The HTML page and the Rerun recording of a run."""

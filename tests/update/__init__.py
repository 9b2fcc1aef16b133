"""Tests of a map that a new drive is added to."""

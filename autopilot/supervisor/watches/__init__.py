"""The checks of each tick, one file per subject; `advance` runs the watches in order."""

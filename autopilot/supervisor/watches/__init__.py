"""What the supervisor watches from tick to tick, one file a subject; `advance` runs the watches in order."""

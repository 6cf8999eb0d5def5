"""Load-position missions: the file format, the trajectory mathematics, and the shipped files."""

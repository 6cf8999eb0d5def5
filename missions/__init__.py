"""Load-position missions: their records, the schema, the file format, and the shipped files."""

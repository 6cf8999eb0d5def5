"""Control laws of one's own, as examples: docs/laws.md tells how they came about."""

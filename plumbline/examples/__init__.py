"""Custom control laws, as examples: docs/laws.md tells how they came about."""

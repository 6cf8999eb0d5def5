"""The ground station: what a person types, what is captured, and the report."""

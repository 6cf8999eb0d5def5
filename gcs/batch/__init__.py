"""Many flights: which must be flown, who flies them, and what a person sees meanwhile."""

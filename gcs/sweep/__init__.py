"""Thousands of flights without the wire: the same cores fused into one kernel, and what becomes of them."""

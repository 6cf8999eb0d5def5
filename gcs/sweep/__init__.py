"""Thousands of flights without the wire: both ticks in one kernel, and the results of the flights."""

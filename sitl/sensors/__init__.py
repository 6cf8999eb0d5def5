"""Measurements of the true state, with their noise, rate and latency. One file per sensor."""

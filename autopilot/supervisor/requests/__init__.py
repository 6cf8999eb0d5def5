"""Requests to the vehicle, one file per subject: the verdict on a request, and the flight after it."""

"""What is asked of the vehicle, one file a subject: the verdict on a request, and the flight after it."""

"""What each sensor's reading does to the estimate, one file a sensor."""

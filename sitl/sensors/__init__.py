"""What is measured of the true state, how well, how often and how late. One file per sensor."""

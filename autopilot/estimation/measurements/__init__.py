"""Corrections of the estimate by the sensors' readings, one file per sensor."""

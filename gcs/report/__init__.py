"""The report of a flight: pictures, a page, a table, and the files that contain them."""

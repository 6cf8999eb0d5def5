"""Published experiments, flown again: a plan of flights in, a table, figures and a page out."""

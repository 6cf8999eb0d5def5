"""Published experiments, flown again: from a plan of flights to tables, figures and a page."""

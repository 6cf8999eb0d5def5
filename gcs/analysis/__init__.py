"""Arrays in, numbers out: telemetry as columns, the record of a flight, flight.parquet."""

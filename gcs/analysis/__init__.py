"""From arrays to numbers: telemetry as columns, the record of a flight, flight.parquet."""

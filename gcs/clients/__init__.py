"""Ground ends of the MAVLink services: machines without socket or clock, fed with datagrams and `now_us`."""

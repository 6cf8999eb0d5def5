"""The ground side of the MAVLink services: state machines without socket or clock, whose inputs are datagrams
and `now_us`."""

"""The side effects of `sitl`: sockets, clock and signals around `sitl.hil`."""

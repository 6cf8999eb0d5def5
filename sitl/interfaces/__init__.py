"""How autopilots of others fly the vehicle: one file an interface, bytes in and bytes out."""

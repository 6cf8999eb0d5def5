"""How third-party autopilots fly the vehicle: one file an interface, bytes in and bytes out."""

"""How third-party autopilots fly the vehicle: one file per interface, bytes in and bytes out."""

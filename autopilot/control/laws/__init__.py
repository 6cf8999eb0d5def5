"""The control laws, one file each, and the interface that they share."""

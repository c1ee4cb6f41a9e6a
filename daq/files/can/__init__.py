"""CAN traffic recorded by other programs."""

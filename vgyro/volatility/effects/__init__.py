"""What an ARCH effect of a gyro's level is."""

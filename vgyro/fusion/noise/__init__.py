"""The noise of each gyro from the differences between them, at rest and in any motion."""

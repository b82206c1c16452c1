"""Single samples that are no plain reading: clipped, missing, rounded, or seen by no gyro."""

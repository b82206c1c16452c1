"""The motion of the board: models of the rate, the smoother, and how each gyro answers to it."""

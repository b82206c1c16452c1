"""Serial dumps: frames found in bytes or lines, and put on one clock."""

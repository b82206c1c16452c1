"""The serial line of a twin: frames, their bytes, and the damage done to them."""

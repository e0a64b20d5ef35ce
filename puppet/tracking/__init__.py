"""Sources of skeleton frames, conditioning, and recording."""

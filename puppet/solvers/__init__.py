"""From what a mapping asks to a pose: kernels over flat arrays."""

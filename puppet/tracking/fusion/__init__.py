"""Several cameras, one performer."""

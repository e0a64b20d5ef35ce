"""Cameras: whatever gives shots, from a device or a file."""

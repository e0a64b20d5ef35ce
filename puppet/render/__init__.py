"""Poses to pictures, in a window or without one."""

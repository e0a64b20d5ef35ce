"""Recorded and synthetic performances."""

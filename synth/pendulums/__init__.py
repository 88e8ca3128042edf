"""Pendulums: how each kind answers a motion of its support."""

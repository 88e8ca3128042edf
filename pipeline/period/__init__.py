"""A single pendulum: its period against amplitude, and the period at infinitesimal arc."""

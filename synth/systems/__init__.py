"""Equations of motion: each system is a NamedTuple of parameters with a derivative."""

"""Exact propagation: the closed form at even times and at any times. No ODE solver anywhere."""

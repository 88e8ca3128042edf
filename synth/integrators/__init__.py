"""Integrators: each takes any system of `synth.systems`, a start, times and a tolerance, and returns a `Trajectory`."""

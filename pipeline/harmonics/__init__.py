"""Amplitude and phase of the harmonic near the pendulum's own frequency, apart from the slow forced motion."""

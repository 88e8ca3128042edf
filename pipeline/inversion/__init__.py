"""Exact nonlinear inversion of the difference pendulum: no ODE solver, one recursion over the samples."""

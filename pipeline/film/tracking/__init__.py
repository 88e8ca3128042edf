"""Following the traces of a film: seeds without clicks, a harmonic Kalman filter both ways, one reading a row."""

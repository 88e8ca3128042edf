"""Photographic film: from the scan of a pendulum record to numbers."""

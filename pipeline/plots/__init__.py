"""Figures of records and results: matplotlib is imported only when one is drawn, and never opens a window."""

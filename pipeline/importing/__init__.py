"""Text tables of times and angles become records."""

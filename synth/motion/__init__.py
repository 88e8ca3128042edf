"""Motion of the support: one file a term, each turned into a sum of harmonics."""

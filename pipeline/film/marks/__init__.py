"""When each row of a film was exposed: gaps found along the traces, counted, and made a time axis."""

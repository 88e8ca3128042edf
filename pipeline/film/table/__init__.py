"""A film on the table: its readings laid over it, corrected by a person in the browser."""

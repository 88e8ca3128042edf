"""What clocks on one support do to each other, read from a record: phases, slips, rates, verdict, stability."""

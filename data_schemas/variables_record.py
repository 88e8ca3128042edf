"""Flags of a record's elongations; the rows of the table of variables for records are in variables_record.txt.

What was read (/record), with what (/instrument), and from which film (/film). A quantity X of the instrument may have
its standard deviation beside it as X_uncertainty.
"""

FLAGS = "gap saturated interpolated time_mark ambiguous lost overlap single_direction outlier"
ELONGATION_FLAGS = {flag: 1 << bit for bit, flag in enumerate(FLAGS.split())}

"""From motion to record: the chronometer's times, the traces, and every defect of a reading."""

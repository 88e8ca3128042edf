"""What the record itself tells of its sensors: a trace that is late, of wrong gain or sign, or in the other's place."""

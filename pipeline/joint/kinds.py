"""What a constant of the joint model acts on."""

START, GRAVITY, DAMPING, QUADRATIC, DRY, FADE, RATIO, SWAY, HEAVE_SCALE, HEAVE_DELAY, KNOCK = range(11)
"""They move the pendulums."""
ZERO, DRIFT, GAIN, DELAY, STEP, CLOCK, CUBIC, CROSS = range(11, 19)  # are in the reading
READ_HEAVE_SCALE, READ_HEAVE_DELAY = range(19, 21)  # the same of a recorded heave that is a reading

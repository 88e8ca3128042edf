"""What a constant of the joint model acts on."""

START, GRAVITY, DAMPING, QUADRATIC, DRY, FADE, RATIO, HEAVE_SCALE, HEAVE_DELAY, KNOCK = range(10)  # move the pendulums
ZERO, DRIFT, GAIN, DELAY, STEP, CLOCK, CUBIC = range(10, 17)  # are in the reading
READ_HEAVE_SCALE, READ_HEAVE_DELAY = range(17, 19)  # the same of a recorded heave that is a reading

"""What a constant of the joint model acts on."""

START, GRAVITY, DAMPING, QUADRATIC, DRY, RATIO, HEAVE_SCALE, HEAVE_DELAY, KNOCK = range(9)  # move the pendulums
ZERO, DRIFT, GAIN, DELAY, STEP, CLOCK = range(9, 15)  # are in the reading

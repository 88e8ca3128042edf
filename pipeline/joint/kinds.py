"""What a constant of the joint model acts on."""

START, GRAVITY, DAMPING, QUADRATIC, DRY, RATIO, HEAVE_SCALE, HEAVE_DELAY = range(8)  # move the pendulums
ZERO, DRIFT, GAIN, DELAY, STEP, CLOCK = range(8, 14)  # are in the reading

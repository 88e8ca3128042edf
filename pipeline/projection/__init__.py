"""The exact linear identity: the difference pendulum driven by the recorded first pendulum, fitted by projection.

    theta'' + 2 gamma2 theta' + n2^2 theta = (1-r) theta1'' + 2 (gamma2 - r gamma1) theta1',   r = (n2/n1)^2

The unknown acceleration of the support is eliminated, nothing is neglected, and the slow motion need not be separated.
"""

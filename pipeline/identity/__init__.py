"""The exact identities of clean uniform records: the difference pendulum driven by the recorded first pendulum.

    d'' + 2 gamma2 d' + n2^2 F(d) = (1-r) theta1'' + 2 (gamma2 - r gamma1) theta1',   r = (n2/n1)^2

The unknown acceleration of the support is eliminated between the two equations of motion (formula sheet, section 1.1),
nothing is neglected, and the slow motion need not be separated. Linear pendulums have F = d, real ones

    F = (1 + zeta) sin d / cos theta1 + w ((cos d - 1) + tan theta1 sin d),   w = (theta1'' + 2 gamma1 theta1')/n1^2
"""

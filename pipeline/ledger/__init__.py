"""The ledger: every correction of gravity, one file each, with sign, size, uncertainty and source.

A correction is a module with

    NAME      its name in results
    FORMULA   in words and symbols
    SOURCE    of the formula
    NEEDS     variables of /instrument without which it is listed as not applied
    USES      further ones that it may use (the uncertainties of NEEDS apart)
    change    `(Case, gravity) -> Change`: the next value of gravity, m s-2

`book` applies them in the order of `book.corrections`; each starts from the gravity that the one before it leaves, so
that the differences add up to the whole without a remainder. A new correction is a module and a line there.
"""

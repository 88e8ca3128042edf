"""The ledger: every correction of gravity with sign, size, uncertainty and source.

`book` applies them in the order of `book.corrections`; each starts from the gravity that the one before it leaves, so
that the differences add up to the whole without a remainder. A new one is a function under `entry.correction`, and a
name in the list of `book`.
"""

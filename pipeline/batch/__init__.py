"""Thousands of records: each in its own process, one ledger, one summary, and nothing lost."""

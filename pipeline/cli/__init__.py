"""The command line: one file a verb, each cheap to list and heavy only when it runs."""

"""Its presence puts this folder on the path, so that tests here import `fuzz_targets` and `sealing`."""

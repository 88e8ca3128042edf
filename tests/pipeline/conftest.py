"""Its presence puts this folder on the path, so that tests in subfolders import `exact_pair` and `made_records`."""

"""Its presence puts this folder on the path, so that tests here import `mark_lists`, `small_film` and `spot_film`."""

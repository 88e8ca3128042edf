"""Suite `honesty`: whether the stated uncertainty covers the error, on every kind of disturbance of a record."""

"""Suite `honesty`: whether the stated uncertainty covers the error, on every kind of disturbance that a record may carry."""

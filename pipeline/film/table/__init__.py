"""The reading table: a page on this machine at which a person corrects the reading of a film."""

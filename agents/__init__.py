"""Training, evaluation and reports. Used from a checkout; not part of the installed package."""

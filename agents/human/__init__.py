"""A person at the table: a match against the clock on the wall, and its sounds."""

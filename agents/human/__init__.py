"""A person at the table, with a mouse: the window of a match, and its sounds."""

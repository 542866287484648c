"""The documentation, and how its site is built (conf.py)."""

"""Data sets for offline learning: episodes of a player, in Minari's format.

`settings` is the environment of a data set, `episodes` plays it in the batch, `human` reads what people played,
`storage` writes a Minari data set, and `replaying` plays one again and compares every bit.
"""

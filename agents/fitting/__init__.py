"""Fitting a table's physics to the track of a puck on it.

It has a room of its own because it measures tables, where `agents.measuring` measures players. A fit runs through
`tracks` (files), `flights` (cutting a track where the puck was struck), `glides` (the deceleration), `bounces` (the
walls) and `fit` (a `TableSpec` with intervals). `report` prints and draws a fit, and `simulated` makes tracks to try
it on.
"""

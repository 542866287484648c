"""Recipes for Ray's RLlib: a player alone, self-play, and the policies of both as files that every command plays."""

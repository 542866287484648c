"""Measuring players: points and tasks, the ladder, score cards."""

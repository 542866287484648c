"""How well somebody plays: points and tasks, the ladder, the score card."""

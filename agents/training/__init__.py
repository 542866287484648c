"""Training runs: recipes, their folders, and what stops and resumes them."""

"""One step of the game, compiled: `step` is the recipe, and its ingredients lie beside it."""

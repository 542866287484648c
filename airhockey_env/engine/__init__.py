"""Physics only: discs, walls, posts, time and contacts. Nothing here knows scores, rewards, Gymnasium or randomness."""

"""Physics alone: discs, walls, posts, time and contacts. No score, reward, Gymnasium or random numbers in here."""

"""Who plays the right paddle: pools of opponents, trained policies, and how they are asked."""

"""How well `scripts.fit_table` recovers simulated tables."""

"""Pages of a run: its scene, results and pictures; they know records, and nothing of what made them."""

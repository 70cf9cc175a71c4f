"""One page of a run: what was simulated, found and drawn; it knows records, and nothing of what made them."""

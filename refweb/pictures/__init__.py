"""A result folder drawn; it knows folders, and nothing of what made them."""

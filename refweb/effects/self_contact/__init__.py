"""Lines against lines: which are near, how they push each other apart, and what that takes from their motion."""

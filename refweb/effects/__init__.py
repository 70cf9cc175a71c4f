"""What acts on a net, one file an effect; no effect knows another, a global matrix or a solver."""

"""The model: nodes, lines, lengths, laws, elements, mass, bodies; it knows no forces, time or solvers."""

"""Least-squares fit of error sources: equations, nodes, prescribed parameters, three methods."""

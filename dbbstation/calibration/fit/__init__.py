"""The fit: equations, nodes, prescribed parameters, three methods."""

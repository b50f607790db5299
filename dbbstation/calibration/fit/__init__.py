"""The fit: its equations, samples seen through nodes, prescribed parameters, the paper's three ways to calibrate."""

"""What is fitted to raw circles and how: sources, observability, uncertainty, evaluation. Pure mathematics."""

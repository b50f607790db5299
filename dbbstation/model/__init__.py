"""Machine models: nominal geometry plus error sources, predicted and inverted."""

"""Compare fits with plan, stated scatter, noise and physics."""

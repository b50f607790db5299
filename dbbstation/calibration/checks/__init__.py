"""What recordings can determine, and whether a fit agrees with what was stated: plan, scatter, noise, physics."""

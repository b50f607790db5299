"""Machine models, nominal geometry plus error sources: prediction and inversion."""

"""A machine model: nominal geometry plus error sources. Predicts poses and bar readings, and can be inverted."""

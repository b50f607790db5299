"""Fitting and judging models of one measured channel. Knows columns, noise and priors; knows no hexapod."""

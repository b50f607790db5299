"""Compiled loops, background threads and BLAS thread limits."""

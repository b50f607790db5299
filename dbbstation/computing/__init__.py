"""Background threads, worker processes and BLAS thread limits."""

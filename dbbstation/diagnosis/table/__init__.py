"""Compare measured and simulated values of any table."""

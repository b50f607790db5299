"""Values with uncertainty, and their conversion to JSON."""

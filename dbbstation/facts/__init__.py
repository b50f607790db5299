"""What facts are made of: a value with its uncertainty, and the one way to JSON."""

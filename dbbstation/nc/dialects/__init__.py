"""NC dialects: the program finds each file that contains a `Dialect`."""

"""NC dialects: each file with a `Dialect` in it is found."""

"""NC dialects, one file each. A file with a `Dialect` in it is a dialect: nothing else needs to be told."""

"""One file with a schema per file format."""

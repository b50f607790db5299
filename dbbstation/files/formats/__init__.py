"""One file per format of a file that people write or exchange, each with its schema."""

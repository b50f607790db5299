"""YAML text read with the line and column of every node, checked against a schema, and written."""

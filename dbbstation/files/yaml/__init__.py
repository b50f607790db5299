"""YAML with the line and column of every node: read, checked, written."""

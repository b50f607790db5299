"""File formats: schemas, places for messages, whole-or-nothing writing, sessions."""

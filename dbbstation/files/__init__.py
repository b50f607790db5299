"""File formats: schemas, positions for messages, atomic writing, sessions."""

"""Every file format: schemas, places for error messages, whole-or-nothing writing, the session with its journal."""

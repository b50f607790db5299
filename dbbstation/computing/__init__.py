"""Processes that end with the program, and threads of linear algebra."""

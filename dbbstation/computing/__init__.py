"""Where computing is done: processes that end with the program, and how many threads linear algebra has."""

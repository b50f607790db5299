"""What is recorded: run files with their journal, the session folder, recordings of one drive."""

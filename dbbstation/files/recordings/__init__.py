"""Run files with their journal, session folders, recordings of drives."""

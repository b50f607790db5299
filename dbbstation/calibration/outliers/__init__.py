"""Find, name and free foreign runs and displaced balls."""

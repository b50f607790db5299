"""Services for a screen."""

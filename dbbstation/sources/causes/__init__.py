"""Physical causes of error, one file each; the registry finds them by looking."""

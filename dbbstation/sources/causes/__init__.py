"""Physical causes of error, one file each, found by the registry."""

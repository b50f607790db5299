"""Physical causes of error, one file each; the registry imports them."""

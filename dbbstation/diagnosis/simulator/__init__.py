"""A simulator in the loop: refitted, probed at ports, compared."""

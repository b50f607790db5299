"""A simulator in the loop: refitted, asked at its ports, and compared with recordings."""

"""Texts: what a cause says of itself, digits of numbers, the order in which people count, what a terminal may be sent."""

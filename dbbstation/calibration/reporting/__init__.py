"""A fit as figures: circles before and after, the machine's plane, maps over the jig plate, plain numbers."""

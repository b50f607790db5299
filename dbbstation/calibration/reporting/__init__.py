"""A fit as figures: circles, plane, maps, plain numbers."""

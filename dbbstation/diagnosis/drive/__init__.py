"""One drive on its own: mass, friction, and which physics a model of these leaves out. Knows no hexapod."""

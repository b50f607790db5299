"""Two sessions side by side: one as the simulation of the other, on the channel of `inference`."""

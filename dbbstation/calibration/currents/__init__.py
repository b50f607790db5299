"""Motor currents as a second channel of a fit."""

"""Motor currents as a second channel of a fit: which readings can be used, and what they determine."""

"""Laws shared by causes: warm-up, thermometers, play, speed, screws, weights."""

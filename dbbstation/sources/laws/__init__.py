"""What causes share: warm-up, thermometers, turning points, speed, screws, weights."""

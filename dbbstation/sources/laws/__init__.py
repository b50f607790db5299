"""What causes of circles share: warm-up, thermometers, turning points, speeds, screws, weights."""

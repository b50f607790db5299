"""What a model of mass and viscous friction may leave out, one cause per file."""

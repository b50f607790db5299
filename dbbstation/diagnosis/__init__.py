"""What recordings show that a model lacks: detect, locate, name, ask."""

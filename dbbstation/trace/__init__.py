"""Record, cut and analyse bar lengths along circles."""

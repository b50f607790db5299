"""Record, cut and analyse bar lengths along circles; raw and centred circles are two types."""

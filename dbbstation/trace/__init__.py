"""Bar trajectories: recorded, cut, analysed; raw and centred are two types."""

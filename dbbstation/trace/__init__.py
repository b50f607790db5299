"""Bar trajectories: as recorded, cut to the circle, analysed. Raw and centred are two types. Pure mathematics."""

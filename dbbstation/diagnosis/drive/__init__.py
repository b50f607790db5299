"""One drive: mass, friction, missing physics, without hexapod."""

"""Geometry, kinematics, Jacobians, travel and statics of the hexapod."""

"""The hexapod: geometry, kinematics, Jacobians, travel, statics."""

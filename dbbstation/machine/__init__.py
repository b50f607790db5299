"""The hexapod itself: geometry, inverse and forward kinematics, Jacobians, travel, statics. Pure mathematics."""

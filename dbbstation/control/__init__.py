"""The correction inside a control: a LinuxCNC kinematics made of a model, or parameters for an existing one."""

"""The correction inside a control: a LinuxCNC kinematics made of a model, or parameters for one that is there."""

"""The whole job on a virtual machine, and four corrections of it under LinuxCNC."""

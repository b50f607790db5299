"""The whole job on a virtual machine, and four corrections of this machine under LinuxCNC."""

"""Users' simulators: reading, running in processes, writing found terms as code."""

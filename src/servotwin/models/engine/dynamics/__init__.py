"""Which forces and currents act in a mode: accelerations, rates and coefficients."""

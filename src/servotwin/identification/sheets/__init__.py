"""Data sheets: from printed torque, speed and currents to a servo file with ranges, and what contradicts what."""

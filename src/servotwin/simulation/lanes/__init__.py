"""Many servos at once: in one call from start to end, or in ticks, from Python and from C."""

"""Servos on one supply: the queue of their events, their common motions, and ticks of all together."""

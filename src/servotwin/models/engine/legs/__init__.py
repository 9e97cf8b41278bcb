"""Motions from event to event without a record: digital servos from tick to tick, gears with play."""

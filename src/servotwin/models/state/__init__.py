"""Modes and states, records of named tuples, reproducible noise: what terms and engine both speak of."""

"""Modes, events, motions and the one step, as plain functions over floats; they know `math` and nothing else."""

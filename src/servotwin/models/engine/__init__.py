"""Modes, events, motions and the one step, as plain functions over floats; they use `math` and nothing else."""

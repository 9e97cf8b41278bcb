"""Servos of a maker that servotwin does not know: each file of this folder that ends in .toml is one."""

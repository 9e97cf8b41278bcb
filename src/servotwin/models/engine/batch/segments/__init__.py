"""Segments of lanes side by side: linear, piecewise, with inductance, with heat."""

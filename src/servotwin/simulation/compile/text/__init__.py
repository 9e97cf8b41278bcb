"""Kernels as text: the functions that a recipe reaches are read, derived, given kinds, and translated."""

"""Experiments, the rigs that they run on, and the recorder that writes their logs."""

"""Uploads of visitors: a log of their own, its twin beside it, and a fit, each computed in a process of its own."""

"""Logs of measured runs: what one is, and how files of several formats are read and written."""

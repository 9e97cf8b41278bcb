"""Ends of modes."""

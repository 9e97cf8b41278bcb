"""Lessons at the bench, and a servo whose numbers are hidden."""

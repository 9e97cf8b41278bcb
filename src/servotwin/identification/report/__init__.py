"""Pages about a fit, and the units in which people read its numbers."""

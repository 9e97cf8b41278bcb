"""Fits to logs: what is searched, the search, how surely it knows, what it cannot say, and what to record next."""

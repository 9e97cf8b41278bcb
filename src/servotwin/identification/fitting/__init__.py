"""Fits to logs: what is searched, the search, how certain it is, what it cannot say, and what to record next."""

"""The bench as one file: a page that computes by itself, without a server, Python or a network."""

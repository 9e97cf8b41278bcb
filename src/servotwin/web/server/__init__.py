"""The server of the page: who is let in, what they say, and benches that run in real time."""

"""The server of the page: who is let in, what they say, and benches that go on in real time."""

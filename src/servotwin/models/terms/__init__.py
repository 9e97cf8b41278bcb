"""One physical term a file: its numbers, what they are where it is absent, and its laws on plain floats."""

"""A bus servo of the maker that answers as a Feetech STS3215 does, with a model number of its own."""

from servotwin.bench.bus import MODELS

NUMBER = 9001


def models():
    """Return pairs of register model and family."""
    like = MODELS["feetech", 777]
    return [(like._replace(number=NUMBER, name="Acme B1"), like.family)]

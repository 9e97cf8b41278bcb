"""`simulate` in plain Python, whatever there is: the text that C is printed from, to hold compiled runs against."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

import servotwin as st
from servotwin.models import Model
from servotwin.signals import Signal
from servotwin.simulation import Result
from servotwin.simulation.compile import backend


@contextmanager
def plain() -> Iterator[None]:
    """Run all within in plain Python."""
    backend._without_compiler.append(True)
    try:
        yield
    finally:
        backend._without_compiler.pop()


def simulate(model: Model, command: Signal, **asked: object) -> Result:
    """Run a servo as `servotwin.simulate` does, and look at it at its output times."""
    with plain():
        result = st.simulate(model, command, **asked)
        result[result.names[1]]  # states at the output times, kept with the result
        return result


def is_the_same(compiled: Result, plain: Result, within: float = 1e-12) -> None:
    """Assert that two results are of one run: its motions, its events, and samples but for rounding."""
    assert [event.kind for event in compiled.events] == [event.kind for event in plain.events]
    assert (compiled.status, compiled.stats) == (plain.status, plain.stats)
    for name in plain.names:
        np.testing.assert_allclose(compiled[name], plain[name], rtol=within, atol=within, err_msg=name)

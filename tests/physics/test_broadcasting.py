"""Every law takes numbers and arrays alike, broadcasts all of its arguments, and gives the same kind back."""

import inspect

import numpy as np
import pytest

from servotwin import physics
from servotwin.physics import sheet


def _arguments(law):
    """The names of a law's arguments; what it takes as one table, or as yes or no, is left out."""
    return [name for name, p in inspect.signature(law).parameters.items()
            if p.annotation in ("float", "Real", "Real | None")]


def _takes_a_table(law):
    return "ArrayLike" in {p.annotation for p in inspect.signature(law).parameters.values() if p.default is p.empty}


LAWS = [law for law in (getattr(physics, name) for name in physics.__all__)
        if inspect.isfunction(law) and inspect.unwrap(law).__module__ != sheet.__name__ and not _takes_a_table(law)]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
def test_numbers_give_a_number(law):
    for result in _parts(law(**{name: 1.5 + 0.1 * k for k, name in enumerate(_arguments(law))})):
        assert isinstance(result, float | bool)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
def test_each_argument_broadcasts_and_each_lane_equals_its_own_call(law):
    names = _arguments(law)
    rng = np.random.default_rng(3)
    base = {name: float(x) for name, x in zip(names, rng.uniform(0.5, 2.0, len(names)), strict=True)}
    for name in names:
        column = rng.uniform(0.5, 2.0, (3, 1))
        results = np.broadcast_arrays(*_parts(law(**{**base, name: column})))
        alone = [_parts(law(**{**base, name: float(x)})) for x in column[:, 0]]
        for k, result in enumerate(results):
            assert result.shape == (3, 1)
            np.testing.assert_allclose(result[:, 0].astype(float), [float(one[k]) for one in alone], rtol=1e-13)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
def test_rows_and_columns_make_a_table_and_nothing_is_changed(law):
    names = _arguments(law)
    rng = np.random.default_rng(4)
    given = {name: rng.uniform(0.5, 2.0, (4, 1) if k % 2 else (1, 5)) for k, name in enumerate(names)}
    before = {name: value.copy() for name, value in given.items()}
    assert np.broadcast_shapes(*(part.shape for part in _parts(law(**given)))) == (4, 5)
    for name in names:
        np.testing.assert_array_equal(given[name], before[name])


def _parts(result):
    return result if isinstance(result, tuple) else (result,)

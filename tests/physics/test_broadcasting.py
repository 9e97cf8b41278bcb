"""Every law takes numbers and arrays alike, broadcasts all of its arguments, and gives the same kind back."""

import inspect

import numpy as np
import pytest

from servotwin.physics import analog_servo, bridge, electronics, friction, gear, motor, potentiometer, pulse

LAWS = [
    law
    for module in (analog_servo, bridge, electronics, friction, gear, motor, potentiometer, pulse)
    for name, law in inspect.getmembers(module, inspect.isfunction)
    if law.__module__ == module.__name__ and not name.startswith("_")
]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
def test_numbers_give_a_number(law):
    result = _call(law, {name: 1.5 for name in inspect.signature(law).parameters})
    assert isinstance(result, float | bool)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
def test_each_argument_broadcasts_and_each_lane_equals_its_own_call(law):
    names = list(inspect.signature(law).parameters)
    rng = np.random.default_rng(3)
    base = {name: float(x) for name, x in zip(names, rng.uniform(0.5, 2.0, len(names)), strict=True)}
    for name in names:
        column = rng.uniform(0.5, 2.0, (3, 1))
        result = _call(law, {**base, name: column})
        assert isinstance(result, np.ndarray)
        assert result.shape == (3, 1)
        alone = [_call(law, {**base, name: float(x)}) for x in column[:, 0]]
        np.testing.assert_allclose(np.asarray(result[:, 0], dtype=float), np.asarray(alone, dtype=float), rtol=1e-13)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
def test_rows_and_columns_make_a_table_and_nothing_is_changed(law):
    names = list(inspect.signature(law).parameters)
    rng = np.random.default_rng(4)
    given = {name: rng.uniform(0.5, 2.0, (4, 1) if k % 2 else (1, 5)) for k, name in enumerate(names)}
    before = {name: value.copy() for name, value in given.items()}
    assert _call(law, given).shape == (4, 5)
    for name in names:
        np.testing.assert_array_equal(given[name], before[name])


def _call(law, arguments):
    positional = [n for n, p in inspect.signature(law).parameters.items() if p.kind is not p.KEYWORD_ONLY]
    rest = {name: value for name, value in arguments.items() if name not in positional}
    return law(*(arguments[name] for name in positional), **rest)

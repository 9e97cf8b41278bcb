"""Samples without a value: when no pulses are sent, and which frames that leaves."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from servotwin import signals
from servotwin.errors import CommandError

NAN = math.nan
TIME = [0.0, 0.1, 0.2, 0.3, 0.4]


@pytest.mark.parametrize(("time", "value", "silences", "held", "initial"), [
    (TIME, [1.0, NAN, NAN, 2.0, 3.0], ((0.1, 0.3),), [1.0, 1.0, 1.0, 2.0, 3.0], 1.0),
    (TIME, [NAN, NAN, 1.0, 2.0, 3.0], ((-math.inf, 0.2),), [1.0, 1.0, 1.0, 2.0, 3.0], 1.0),
    (TIME, [1.0, 2.0, NAN, 3.0, NAN], ((0.2, 0.3), (0.4, math.inf)), [1.0, 2.0, 2.0, 3.0, 3.0], 1.0),
    ([-0.3, -0.2, -0.1, 0.3, 0.4], [1.0, 2.0, NAN, 3.0, 3.0], ((-0.1, 0.3),), [2.0, 2.0, 2.0, 3.0, 3.0], 2.0),
    ([0.1, 0.2, 0.25, 0.3, 0.4], [NAN, 2.0, 2.0, NAN, 2.0], ((-math.inf, 0.2), (0.3, 0.4)), [2.0] * 5, 2.0),
    (TIME, [1.0, 2.0, 3.0, 4.0, 5.0], (), [1.0, 2.0, 3.0, 4.0, 5.0], 1.0),
])
@pytest.mark.parametrize("unit", ["ms", "deg", "rad"])
def test_nan_is_silence_and_the_value_is_held_through_it(time, value, silences, held, initial, unit):
    signal = signals.samples(time, value, unit=unit)
    assert signal.silences == silences
    plain = signals.samples(TIME, held, unit=unit)
    np.testing.assert_array_equal(signal(TIME), plain(TIME))
    assert signal.initial == signals.constant(initial, unit=unit).initial


@pytest.mark.parametrize(("value", "first"), [
    ([1.0, 1.0, NAN, 1.0, 1.0], 0.2), ([NAN, NAN, 1.0, 1.0, 1.0], 0.2), ([1.0, 2.0, NAN, 1.0, 1.0], 0.1),
    ([NAN, 1.0, 2.0, 1.0, 1.0], 0.1), ([1.0] * 5, None),
])
def test_when_it_changes_first(value, first):
    assert signals.samples(TIME, value, unit="ms").first_change == first


@given(some.lists(some.booleans(), min_size=1, max_size=12).filter(any), some.sampled_from([0.003, 0.01, 0.02, 0.7]),
       some.sampled_from([0.0, 0.01, 0.095, 0.4]), some.sampled_from([0.0, -0.13, 0.05]))
def test_frames_count_on_and_those_in_silence_are_left_out(sent, period, until, start):
    """Each edge by itself: the latest sample at it, with a billionth of a frame for rounding, says whether it is."""
    time = start + 0.02 * np.arange(len(sent))
    signal = signals.samples(time, np.where(sent, 1.5, NAN), unit="ms")
    framed = signal.framed(period, until)
    if all(sent):
        assert framed is signal
        return
    assert framed.silences == ()
    assert (framed.pieces, framed.initial, framed.unit) == (signal.pieces, signal.initial, signal.unit)
    edges = np.arange(round(3.0 * until / period) + 20) * period
    due = [edge for edge in edges.tolist()
           if sent[max(int(np.sum(time <= edge + 1e-9 * period)) - 1, 0)]]
    count = len(framed.edges)
    assert framed.edges == tuple(due[:count])
    assert all(edge > until for edge in due[count:])


def test_what_cannot_be_silent():
    silent = signals.samples(TIME, [1.0, NAN, 1.0, 1.0, 1.0], unit="ms")
    with pytest.raises(CommandError, match=r"frames.*at most"):
        silent.framed(1e-9, 1.0)
    for more, words in [({"unit": "V"}, "a voltage"), ({"edges": (0.0, 1.0)}, "one of both"),
                        ({"silences": ((0.2, 0.1),)}, "one after the other"),
                        ({"silences": ((0.0, 0.1), (0.1, 0.2))}, "one after the other"),
                        ({"silences": ((NAN, 0.1),)}, "one after the other")]:
        with pytest.raises(CommandError, match=words):
            replace(silent, **more)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: signals.samples(TIME, [1.0, NAN, 1.0, 1.0, 1.0], unit="V"), ("sample 1", "nan", "only pulses and angles")),
    (lambda: signals.samples(TIME, [1.0, NAN, 1.0, 1.0, 1.0], unit="ms", hold="linear"), ("sample 1", "previous")),
    (lambda: signals.samples(TIME, [NAN] * 5, unit="deg"), ("no value that is a number", "no pulses")),
    (lambda: signals.samples(TIME, [NAN, math.inf, 1.0, 1.0, 1.0], unit="deg"), ("sample 1", "inf")),
    (lambda: signals.samples([NAN, *TIME[1:]], [1.0] * 5, unit="deg"), ("time of sample 0", "nan")),
    (lambda: signals.pulse_train(TIME, [1.0, NAN, 1.0, 1.0, 1.0], unit="ms"), ("value of sample 1", "nan")),
])
def test_where_nan_means_nothing_it_is_refused_in_one_line(call, words):
    with pytest.raises(CommandError) as caught:
        call()
    assert all(word in str(caught.value) for word in words), str(caught.value)

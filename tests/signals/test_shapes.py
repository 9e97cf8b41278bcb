"""Each shape has the values that its formula says, in the caller's unit, and steps where it says."""

import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from servotwin import signals, units
from servotwin.errors import CommandError
from servotwin.physics.pieces import Piece, Pieces
from servotwin.signals.signal import KIND_NAMES, KINDS, headers

FACTOR = {"deg": math.pi / 180.0, "rad": 1.0, "us": 1e-6, "ms": 1e-3, "s": 1.0, "V": 1.0, "mV": 1e-3}
KIND = {"deg": "angle", "rad": "angle", "us": "pulse_width", "ms": "pulse_width", "s": "pulse_width",
        "V": "voltage", "mV": "voltage"}

SHAPES = {
    "constant": lambda unit: signals.constant(3.0, unit=unit),
    "step": lambda unit: signals.step(3.0, 4.0, at=0.5, unit=unit),
    "ramp": lambda unit: signals.ramp(3.0, 4.0, at=0.25, over=0.5, unit=unit),
    "sine": lambda unit: signals.sine(mean=3.0, amplitude=0.5, frequency=2.0, phase=0.3, unit=unit),
    "chirp": lambda unit: signals.chirp(mean=3.0, amplitude=0.5, start_frequency=1.0, end_frequency=5.0, duration=0.7,
                                        unit=unit),
    "prbs": lambda unit: signals.prbs(3.0, 4.0, bit_time=0.02, duration=1.0, unit=unit),
    "held": lambda unit: signals.samples([0.0, 0.3, 0.6], [3.0, 4.0, 3.5], unit=unit),
    "linear": lambda unit: signals.samples([0.0, 0.3, 0.6], [3.0, 4.0, 3.5], unit=unit, hold="linear"),
}
TIMES = np.linspace(0.0, 1.0, 41)

each_shape = pytest.mark.parametrize("shape", SHAPES)


def refused(call, *words):
    with pytest.raises(CommandError) as caught:
        call()
    text = str(caught.value)
    assert text.isprintable()
    assert all(word in text for word in words), text


# ---------------------------------------------------------------------------------------- common to all

def test_the_units_are_the_seven():
    assert {unit: kind for unit, (kind, _) in KINDS.items()} == KIND


@each_shape
def test_the_unit_only_scales(shape):
    plain = SHAPES[shape]("V")
    for unit, factor in FACTOR.items():
        signal = SHAPES[shape](unit)
        assert signal.kind == KIND[unit]
        assert signal.unit == unit
        np.testing.assert_allclose(signal(TIMES), factor * plain(TIMES), rtol=1e-14)
        assert signal.initial == pytest.approx(factor * plain.initial, rel=1e-14)


@each_shape
def test_before_the_start_it_has_its_first_value(shape):
    """None of these jumps at t = 0, so the value just before is the one at 0."""
    signal = SHAPES[shape]("V")
    assert signal.initial == signal(0.0)


@each_shape
def test_any_shape_of_times(shape):
    signal = SHAPES[shape]("V")
    flat = signal(TIMES[:40])
    assert signal(0.25).shape == ()
    np.testing.assert_array_equal(signal(TIMES[:40].reshape(4, 10)), flat.reshape(4, 10))
    np.testing.assert_array_equal(signal(TIMES[:40][::-1].tolist()), flat[::-1])


@each_shape
def test_signals_compare_and_travel(shape):
    signal = SHAPES[shape]("us")
    again = pickle.loads(pickle.dumps(signal))
    assert again == signal == SHAPES[shape]("us")
    assert hash(again) == hash(signal)
    assert signal != SHAPES[shape]("ms")
    np.testing.assert_array_equal(again(TIMES), signal(TIMES))
    assert pickle.dumps(again) == pickle.dumps(SHAPES[shape]("us"))


def test_headers_say_what_signals_say():
    given = [SHAPES[shape](unit) for shape in SHAPES for unit in KINDS]
    given += [signals.constant(3.0, unit="ms", frame_period=0.02), signals.pulse_train([-0.5, 0.5], [1500.0, 1600.0])]
    for signal, head in zip(given, headers(given), strict=True):
        low, high = signal.pieces.extremes
        assert KIND_NAMES[head["kind"]] == signal.kind
        assert head["initial"] == signal.initial
        assert (head["lowest"], head["highest"]) == (min(low, signal.initial), max(high, signal.initial))
        assert head["pieces"] == len(signal.pieces.table)
        assert head["edges"] == (-1 if signal.edges is None else len(signal.edges))
        for name in ("frame_period", "first_change"):
            value = getattr(signal, name)
            np.testing.assert_equal(head[name], math.nan if value is None else value)


@each_shape
def test_an_unknown_unit_is_refused(shape):
    for unit in ("", "Deg", "kg", "%", None, 3, ["V"]):
        refused(lambda unit=unit: SHAPES[shape](unit), "unit of a command", "deg, rad, us, ms, s, V, mV")


# ---------------------------------------------------------------------------------------- one by one

@pytest.mark.parametrize("at", [-0.5, 0.0, 0.5, 1e-9, 1e9, 1e17, -1e17])
def test_a_step_is_right_continuous(at):
    signal = signals.step(1.0, 2.0, at=at, unit="V")
    just_before = np.nextafter(at, -math.inf)
    assert signal(at) == 2.0
    assert signal(just_before) == 1.0
    assert signal(-1e300) == 1.0
    assert signal(1e300) == 2.0
    assert signal.initial == (2.0 if at < 0.0 else 1.0)


def test_a_step_down_and_a_step_of_nothing():
    assert signals.step(2.0, -1.0, at=1.0, unit="V")([0.0, 1.0]).tolist() == [2.0, -1.0]
    assert signals.step(2.0, 2.0, at=1.0, unit="V")([0.0, 1.0]).tolist() == [2.0, 2.0]


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-2.0, 2.0), st.floats(1e-3, 3.0))
def test_a_ramp_is_a_clipped_line(before, after, at, over):
    signal = signals.ramp(before, after, at=at, over=over, unit="V")
    t = np.linspace(-3.0, 6.0, 101)
    expected = before + (after - before) * np.clip((t - at) / over, 0.0, 1.0)
    np.testing.assert_allclose(signal(t), expected, atol=1e-11)
    assert signal.initial == pytest.approx(before + (after - before) * np.clip(-at / over, 0.0, 1.0), abs=1e-11)


@given(st.floats(0.01, 50.0), st.floats(-7.0, 7.0))
def test_a_sine(frequency, phase):
    signal = signals.sine(mean=1.2, amplitude=0.3, frequency=frequency, phase=phase, unit="V")
    expected = 1.2 + 0.3 * np.sin(2.0 * np.pi * frequency * TIMES + phase)
    np.testing.assert_allclose(signal(TIMES), expected, atol=1e-12)
    assert signal.initial == pytest.approx(1.2 + 0.3 * math.sin(phase), abs=1e-15)


def test_a_chirp_sweeps_linearly_and_then_stays():
    f0, f1, T = 0.5, 8.0, 3.0
    signal = signals.chirp(mean=0.0, amplitude=1.0, start_frequency=f0, end_frequency=f1, duration=T, unit="V")
    t = np.linspace(0.0, 2.0 * T, 4001)
    phase = 2.0 * np.pi * np.where(t < T, f0 * t + 0.5 * (f1 - f0) / T * t**2, 0.5 * (f0 + f1) * T + f1 * (t - T))
    np.testing.assert_allclose(signal(t), np.sin(phase), atol=1e-11)


@pytest.mark.parametrize(("f0", "f1"), [(0.5, 8.0), (8.0, 0.5), (2.0, 2.0)])
def test_the_instantaneous_frequency_of_a_chirp(f0, f1):
    """From signal and slope alone: |y'| where y = 0 is 2π f."""
    T = 4.0
    signal = signals.chirp(mean=0.0, amplitude=1.0, start_frequency=f0, end_frequency=f1, duration=T, unit="V")
    t = np.linspace(0.01, T - 0.01, 20001)
    y = signal(t)
    crossings = np.flatnonzero(np.diff(np.sign(y)))
    slopes = np.abs(np.diff(y)[crossings]) / (t[1] - t[0])
    np.testing.assert_allclose(slopes / (2.0 * np.pi), f0 + (f1 - f0) / T * t[crossings], rtol=2e-3)


def test_a_chirp_is_smooth_where_it_stops_sweeping():
    signal = signals.chirp(mean=1.0, amplitude=2.0, start_frequency=0.7, end_frequency=11.3, duration=2.345, unit="V")
    h = 1e-7
    left, at, right = signal([2.345 - h, 2.345, 2.345 + h])
    assert at - left == pytest.approx(right - at, abs=1e-9)
    assert abs(at - left) < 2.0 * 2.0 * np.pi * 11.4 * h


@pytest.mark.parametrize("order", [2, 3, 5, 7, 9, 12])
def test_a_prbs_is_a_sequence_of_maximal_length(order):
    length = 2**order - 1
    signal = signals.prbs(-1.0, 1.0, bit_time=1.0, duration=2.0 * length, order=order, unit="V")
    bits = signal(np.arange(2 * length) + 0.5)
    once = bits[:length]
    np.testing.assert_array_equal(bits[length:], once)  # the period ...
    assert once.sum() == 1.0  # ... has one more of the high than of the low ones,
    shifted = np.array([once @ np.roll(once, k) for k in range(length)])
    assert shifted[0] == length  # and looks like noise: all other shifts correlate alike, and hardly
    assert set(shifted[1:]) == {-1.0}


def test_prbs_seeds_are_shifts_of_one_sequence():
    def bits(seed):
        return signals.prbs(0.0, 1.0, bit_time=1.0, duration=31.0, order=5, seed=seed, unit="V")(np.arange(31) + 0.5)

    assert bits(3).tolist() == bits(3).tolist()
    assert bits(3).tolist() != bits(4).tolist()
    assert any(np.roll(bits(0), k).tolist() == bits(17).tolist() for k in range(31))
    assert bits(-1).tolist() == bits(30).tolist()
    default = signals.prbs(0.0, 1.0, bit_time=1.0, duration=31.0, order=5, unit="V")
    assert default(np.arange(31) + 0.5).tolist() == bits(0).tolist()


def test_a_prbs_changes_at_bit_times_only_and_keeps_its_last_bit():
    signal = signals.prbs(1.0, 2.0, bit_time=0.05, duration=0.52, unit="V")
    starts = np.array([piece.start for piece in signal.pieces.table])
    np.testing.assert_allclose(starts / 0.05, np.round(starts / 0.05), atol=1e-12)
    assert starts.max() <= 0.5
    assert signal(100.0) == signal(0.51)
    assert set(signal(np.linspace(0.0, 1.0, 99)).tolist()) == {1.0, 2.0}


# ---------------------------------------------------------------------------------------- samples

increasing = st.lists(st.floats(0.01, 1.0), min_size=2, max_size=20)


@given(increasing, st.data())
def test_held_samples(gaps, data):
    t = np.cumsum(gaps)
    y = np.array(data.draw(st.lists(st.floats(-9, 9), min_size=len(t), max_size=len(t))))
    signal = signals.samples(t, y, unit="V")
    np.testing.assert_array_equal(signal(t), y)
    np.testing.assert_array_equal(signal(np.nextafter(t[1:], -1.0)), y[:-1])
    np.testing.assert_array_equal(signal([0.0, 1e9]), [y[0], y[-1]])
    assert signal.initial == y[0]


@given(increasing, st.data())
def test_linear_samples(gaps, data):
    t = np.cumsum(gaps)
    y = np.array(data.draw(st.lists(st.floats(-9, 9), min_size=len(t), max_size=len(t))))
    signal = signals.samples(t, y, unit="V", hold="linear")
    dense = np.linspace(0.0, t[-1] + 1.0, 200)
    np.testing.assert_allclose(signal(dense), np.interp(dense, t, y), atol=1e-10)
    assert signal.initial == y[0]


@pytest.mark.parametrize(("times", "values", "before"), [
    ([0.0, 1.0], [5.0, 6.0], 5.0),  # no sample before 0: the first one
    ([0.5, 1.0], [5.0, 6.0], 5.0),
    ([-1.0, 0.0], [5.0, 6.0], 5.0),  # a sample at 0 steps, like a step at 0
    ([-1.0, -0.5, 1.0], [5.0, 6.0, 7.0], 6.0),  # the one in force, like a step at -0.5
    ([-2.0, -1.0], [5.0, 6.0], 6.0),
])
def test_what_held_samples_are_just_before_the_start(times, values, before):
    assert signals.samples(times, values, unit="V").initial == before


def test_linear_samples_cross_the_start():
    signal = signals.samples([-1.0, 1.0], [0.0, 4.0], unit="V", hold="linear")
    assert signal.initial == signal(0.0) == 2.0


def test_one_sample_is_a_constant():
    for hold in ("previous", "linear"):
        assert signals.samples([0.3], [2.0], unit="V", hold=hold)([0.0, 5.0]).tolist() == [2.0, 2.0]


def test_equal_neighbours_are_one_piece():
    signal = signals.samples(np.arange(1000.0), np.repeat([1.0, 2.0], 500), unit="V")
    assert [piece.start for piece in signal.pieces.table] == [0.0, 500.0]


def test_samples_do_not_follow_their_arrays():
    t, y = np.array([0.0, 1.0]), np.array([1.0, 2.0])
    signal = signals.samples(t, y, unit="V")
    y[:] = 7.0
    assert signal(0.0) == 1.0


def test_pulses_one_by_one():
    signal = signals.pulse_train([0.0, 0.02, 0.05], [1500.0, 1600.0, 1550.0])
    assert signal.edges == (0.0, 0.02, 0.05)
    np.testing.assert_allclose(signal([0.0, 0.01, 0.02, 0.06]), [1.5e-3, 1.5e-3, 1.6e-3, 1.55e-3], rtol=1e-15)
    again = signals.pulse_train([0.0, 0.02, 0.05], [1.5, 1.6, 1.55], unit="ms")
    np.testing.assert_allclose(again([0.0, 0.02, 0.05]), signal([0.0, 0.02, 0.05]), rtol=1e-15)


def test_equal_pulses_keep_their_edges():
    signal = signals.pulse_train([0.0, 0.02, 0.04], [1500.0] * 3)
    assert len(signal.pieces.table) == 1
    assert signal.edges == (0.0, 0.02, 0.04)


# ---------------------------------------------------------------------------------------- what is refused

NOT_NUMBERS = [math.nan, math.inf, -math.inf, True, "1.5", None, [1.0], 1j, np.ones(1), 10**400]
CALLS = {
    "constant(value)": lambda x: signals.constant(x, unit="V"),
    "step(before)": lambda x: signals.step(x, 1.0, unit="V"),
    "step(after)": lambda x: signals.step(1.0, x, unit="V"),
    "step(at)": lambda x: signals.step(1.0, 2.0, at=x, unit="V"),
    "ramp(before)": lambda x: signals.ramp(x, 1.0, over=1.0, unit="V"),
    "ramp(after)": lambda x: signals.ramp(1.0, x, over=1.0, unit="V"),
    "ramp(at)": lambda x: signals.ramp(1.0, 2.0, at=x, over=1.0, unit="V"),
    "ramp(over)": lambda x: signals.ramp(1.0, 2.0, over=x, unit="V"),
    "sine(mean)": lambda x: signals.sine(mean=x, amplitude=1.0, frequency=1.0, unit="V"),
    "sine(amplitude)": lambda x: signals.sine(mean=1.0, amplitude=x, frequency=1.0, unit="V"),
    "sine(frequency)": lambda x: signals.sine(mean=1.0, amplitude=1.0, frequency=x, unit="V"),
    "sine(phase)": lambda x: signals.sine(mean=1.0, amplitude=1.0, frequency=1.0, phase=x, unit="V"),
    "chirp(start_frequency)": lambda x: signals.chirp(
        mean=1.0, amplitude=1.0, start_frequency=x, end_frequency=1.0, duration=1.0, unit="V"),
    "chirp(end_frequency)": lambda x: signals.chirp(
        mean=1.0, amplitude=1.0, start_frequency=1.0, end_frequency=x, duration=1.0, unit="V"),
    "chirp(duration)": lambda x: signals.chirp(
        mean=1.0, amplitude=1.0, start_frequency=1.0, end_frequency=2.0, duration=x, unit="V"),
    "prbs(low)": lambda x: signals.prbs(x, 1.0, bit_time=0.1, duration=1.0, unit="V"),
    "prbs(high)": lambda x: signals.prbs(0.0, x, bit_time=0.1, duration=1.0, unit="V"),
    "prbs(bit_time)": lambda x: signals.prbs(0.0, 1.0, bit_time=x, duration=1.0, unit="V"),
    "prbs(duration)": lambda x: signals.prbs(0.0, 1.0, bit_time=0.1, duration=x, unit="V"),
}


@pytest.mark.parametrize("name", CALLS)
def test_what_is_no_finite_number_is_refused(name):
    for value in NOT_NUMBERS:
        refused(lambda value=value: CALLS[name](value), name, "number")


@pytest.mark.parametrize("name", [n for n in CALLS if n.partition("(")[2][:-1] in (
    "over", "frequency", "start_frequency", "end_frequency", "duration", "bit_time")])
@pytest.mark.parametrize("value", [0.0, -1.0])
def test_what_is_not_positive_is_refused(name, value):
    refused(lambda: CALLS[name](value), name, "positive")


@pytest.mark.parametrize("name", CALLS)
def test_numbers_of_every_kind_do(name):
    for value in (1, np.float32(1.0), np.int16(1)):
        signal = CALLS[name](value)
        assert all(type(x) is float for piece in signal.pieces.table for x in piece)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: signals.prbs(0, 1, bit_time=1, duration=1, order=1, unit="V"), ("order", "2 to 20")),
    (lambda: signals.prbs(0, 1, bit_time=1, duration=1, order=21, unit="V"), ("order", "2 to 20")),
    (lambda: signals.prbs(0, 1, bit_time=1, duration=1, order=9.0, unit="V"), ("order", "2 to 20")),
    (lambda: signals.prbs(0, 1, bit_time=1, duration=1, seed=1.5, unit="V"), ("seed", "integer")),
    (lambda: signals.prbs(0, 1, bit_time=1, duration=1, seed=True, unit="V"), ("seed", "integer")),
    (lambda: signals.prbs(0, 1, bit_time=1e-9, duration=1, unit="V"), ("duration / bit_time", "10 000 000")),
    (lambda: signals.ramp(0, 1, at=1.0, over=1e-20, unit="V"), ("ramp(over)",)),
    (lambda: signals.samples([], [], unit="V"), ("no samples",)),
    (lambda: signals.samples([0, 1], [0], unit="V"), ("(2,) and (1,)", "one length")),
    (lambda: signals.samples([[0, 1]], [[0, 1]], unit="V"), ("(1, 2)",)),
    (lambda: signals.samples(0.0, 1.0, unit="V"), ("()",)),
    (lambda: signals.samples([0, 1, 1], [0, 1, 2], unit="V"), ("time of sample 2", "more than 1 s")),
    (lambda: signals.samples([0, 1, 0.5], [0, 1, 2], unit="V"), ("time of sample 2", "got 0.5")),
    (lambda: signals.samples([0, math.nan], [0, 1], unit="V"), ("time of sample 1", "nan")),
    (lambda: signals.samples([0, 1], [0, math.inf], unit="V"), ("value of sample 1", "inf")),
    (lambda: signals.samples([0, 1], ["a", "b"], unit="V"), ("no numbers",)),
    (lambda: signals.samples([0, 1], [0, 10**400], unit="V"), ("no numbers",)),
    (lambda: signals.samples([0, 1], [0, 1j], unit="V"), ("no numbers",)),
    (lambda: signals.samples([0, 1], [[0], [1, 2]], unit="V"), ("no numbers",)),
    (lambda: signals.samples([0, 1], [0, 1], unit="V", hold="next"), ("hold", "previous, linear")),
    (lambda: signals.samples([0, 1e-300], [0, 1e300], unit="V", hold="linear"), ("slope after sample 0",)),
    (lambda: signals.pulse_train([0.0], [1.5], unit="V"), ("unit of a pulse width", "us, ms, s")),
    (lambda: signals.pulse_train([0.0, 0.001], [1500.0, 1500.0]), ("pulse 0", "ends before the next")),
    (lambda: signals.pulse_train([0.0, 0.02, 0.01], [1500.0] * 3), ("time of sample 2",)),
    (lambda: signals.pulse_train([0.0], [0.0]), ("pulse width", "positive")),
])
def test_bad_commands_are_refused_in_one_line(call, words):
    refused(call, *words)


@pytest.mark.parametrize("unit", ["us", "ms", "s"])
@pytest.mark.parametrize("make", [
    lambda unit: signals.constant(0.0, unit=unit), lambda unit: signals.constant(-1.0, unit=unit),
    lambda unit: signals.step(1.0, -1.0, unit=unit), lambda unit: signals.step(-1.0, 1.0, unit=unit),
    lambda unit: signals.ramp(1.0, 0.0, over=1.0, unit=unit),
    lambda unit: signals.sine(mean=1.0, amplitude=1.0, frequency=1.0, unit=unit),
    lambda unit: signals.sine(mean=1.0, amplitude=-2.0, frequency=1.0, unit=unit),
    lambda unit: signals.samples([0.0, 1.0, 2.0], [1.0, 0.0, 1.0], unit=unit, hold="linear"),
])
def test_a_pulse_has_a_positive_width(make, unit):
    refused(lambda: make(unit), "pulse width", "positive")


def test_angles_and_voltages_may_be_negative():
    assert signals.step(-10.0, -20.0, unit="deg")(1.0) == pytest.approx(units.to_si(-20.0, "deg", "angle"))
    assert signals.constant(-1.0, unit="V")(0.0) == -1.0


@pytest.mark.parametrize("unit", ["deg", "rad", "V", "mV"])
def test_only_pulses_have_frames(unit):
    refused(lambda: signals.constant(1.0, unit=unit, frame_period=0.02), "frame_period", "only a pulse signal")


@pytest.mark.parametrize("period", [0.0, -0.02, math.nan, math.inf, "0.02", True])
def test_a_bad_frame_period_is_refused(period):
    refused(lambda: signals.constant(1500.0, unit="us", frame_period=period), "frame_period", "positive")


def test_the_frame_period_is_kept():
    assert signals.constant(1500.0, unit="us", frame_period=0.01).frame_period == 0.01
    assert signals.constant(1500.0, unit="us").frame_period is None


def test_a_signal_made_by_hand_is_checked():
    refused(lambda: signals.Signal(pieces=Pieces((Piece(),)), unit="V", initial=math.nan), "just before")


def test_a_sequence_of_more_bits_than_all_numbers():
    with pytest.raises(CommandError, match="inf bits"):
        signals.prbs(1.0, 2.0, bit_time=1e-300, duration=1e300, unit="V")


@pytest.mark.parametrize("masked", ["time", "value"])
def test_what_a_mask_hides_does_not_count_silently(masked):
    numbers = {"time": np.array([0.0, 0.5, 1.0]), "value": np.array([1.0, 9e9, 2.0])}
    numbers[masked] = np.ma.array(numbers[masked], mask=[False, True, False])
    with pytest.raises(CommandError, match=f"samples: {masked}: got 'a masked array'"):
        signals.samples(**numbers, unit="V")

"""The tornado: units, order, and what it does with values that are not there."""

import math

import pytest

from servotwin import plotting
from servotwin.errors import InputError
from servotwin.models.outputs import SIGNALS
from servotwin.studies import METRICS, Bar, Tornado

BARS = (Bar("motor.armature_resistance", 2.8, 3.3, 0.170, 0.190, 0.02, 0.7),
        Bar("electronics.off_state", "brake", "coast", 0.180, 0.185, 0.005, 0.2),
        Bar("load.inertia", 0.0, 1e-3, math.nan, 0.181, math.nan, math.nan))
TORNADO = Tornado("rise_time", 0.180, BARS)


def words(figure):
    return [text.get_text() for text in figure.axes[0].texts]


def test_bars_reach_from_the_nominal_value_in_shown_units():
    ax = plotting.tornado(TORNADO).axes[0]
    drawn = [(bar.get_x(), bar.get_width()) for bar in ax.patches if bar.get_height() < 0.5]
    assert drawn[0] == pytest.approx((180.0, -10.0))
    assert drawn[1] == pytest.approx((180.0, 10.0))
    assert ax.get_xlabel() == "rise time (ms)"
    assert [label.get_text() for label in ax.get_yticklabels()] == [bar.name for bar in BARS]
    top, bottom = ax.get_ylim()[::-1]
    assert top < bottom  # the first one is on top


def test_ends_and_shares_are_written():
    found = words(plotting.tornado(TORNADO))
    assert {"2.8 Ω", "3.3 Ω", "brake", "coast", "70 %", "20 %", "10 kg cm²"} <= set(found)
    assert any("no value" in text for text in found)


def test_the_sides_differ_without_colour():
    figure = plotting.tornado(TORNADO)
    handles = figure.axes[0].get_legend().get_patches()
    assert [patch.get_hatch() or "" for patch in handles] == ["", "////"]


def test_only_the_most_important_ones_are_drawn():
    assert len(plotting.tornado(TORNADO, most=2).axes[0].get_yticklabels()) == 2
    for bars, most in (((), 12), (BARS, 0)):
        with pytest.raises(InputError):
            plotting.tornado(Tornado("rise_time", 0.18, bars), most=most)


def test_a_tornado_of_nothing_finite_can_be_drawn():
    bars = (Bar("load.inertia", 0.0, 1e-3, math.nan, math.nan, math.nan, math.nan),)
    assert plotting.to_bytes(plotting.tornado(Tornado("overshoot", math.nan, bars)), "png").startswith(b"\x89PNG")


@pytest.mark.long(but="end_motor_speed")
@pytest.mark.parametrize("metric", [*METRICS, *(f"end_{name}" for name in SIGNALS)])
def test_every_metric_has_words_and_a_unit_that_fits(metric):
    shown = plotting.metric_shown(metric)
    assert shown.words
    assert math.isfinite(plotting.tornado(Tornado(metric, 0.1, BARS[:1])).axes[0].get_xlim()[0])


@pytest.mark.parametrize(("value", "dimension", "text"), [
    (3.7e-3, "torque per current", "3.7 mN m/A"), (0.02, "time", "20 ms"), (-1.5, "torque", "-1.5 N m"),
    (0.0, "torque", "0 N m"), (280.0, "number", "280"), (1.0471975511965976, "angle", "60°"),
    (0.41966, "voltage per angle", "7.324 mV/deg"), (2.2e-7, "torque per speed", "0.00022 mN m s/rad"),
])
def test_values_are_readable(value, dimension, text):
    assert plotting.readable(value, dimension) == text


@pytest.mark.parametrize("metric", ["rise_time", "overshoot"])
def test_labels_stand_apart(metric):
    """From a study of 12 parameters whose overshoot only rises: labels of bars lay on the names of the parameters."""
    names = ("electronics.voltage_to_pulse_gain", "motor.rotor_inertia", "friction.load_friction_external_stribeck",
             "supply.open_circuit_voltage", "electronics.off_state")
    ends = ((0.0, 0.0), (0.0, 0.038), (0.017, 0.0), (0.0, 0.0019), (0.0, 0.0))
    if metric == "rise_time":
        ends = ((0.184, 0.185), (0.2, 0.17), (0.1, 0.185), (0.185, 0.186), (0.1849, 0.1851))
    values = [(1.2345e-3, 2.3456e-3)] * 4 + [("brake", "coast")]
    bars = tuple(Bar(name, *value, *end, 0.1, 0.2) for name, value, end in zip(names, values, ends, strict=True))
    figure = plotting.tornado(Tornado(metric, 0.0 if metric == "overshoot" else 0.185, bars))
    figure.canvas.draw()
    ax = figure.axes[0]
    boxes = [text.get_window_extent() for text in (*ax.texts, *ax.get_yticklabels())]
    for k, one in enumerate(boxes):
        assert not any(one.overlaps(other) for other in boxes[k + 1:])
    assert all(0.0 <= box.x0 and box.x1 <= figure.bbox.x1 for box in boxes)

"""The motor of a sheet: exact for one voltage, least squares for several, and ranges that hold all that is open."""

import math

import numpy as np
import pytest

from servotwin.errors import InputError
from servotwin.identification import Sheet, SheetPoint, motor_range, sheet_contradictions
from servotwin.physics import motor_from_sheet

NAMES = ("resistance", "output_torque_constant", "gear_efficiency", "no_load_current", "no_load_torque",
         "coulomb_torque")


def point(V, T_s=None, seconds=None, I_0=None, I_s=None, source=""):
    return SheetPoint(supply_voltage=V, stall_torque=T_s, no_load_speed=math.pi / 3 / seconds if seconds else None,
                      no_load_current=I_0, stall_current=I_s, source=source)


def sheet(*points, **facts):
    return Sheet(name="mine", points=points, **facts)


def printed(V, R, K, eta, I_0, drop, **kept):
    """What the sheet of a known motor prints at a voltage."""
    U = V - drop
    facts = {"stall_torque": eta * K * (U / R - I_0), "no_load_speed": (U - R * I_0) / K, "no_load_current": I_0,
             "stall_current": U / R}
    return SheetPoint(supply_voltage=V, **{name: x for name, x in facts.items() if kept.get(name, True)})


HS_755HB = (point(4.8, 1.0787, 0.28, 0.23), point(6.0, 1.2945, 0.23, 0.285))
HS_311 = (point(4.8, 0.2942, 0.19, 0.16, 0.7), point(6.0, 0.3432, 0.15, 0.18, 0.8))


def test_the_hs_755hb_at_6_volts():
    """R 3.04 (2.75 to 3.7) ohm and K_out 1.04 (1.02 to 1.12) N m/A, computed by hand from T_s, ω_0 and I_0."""
    found = motor_range(sheet(HS_755HB[1]))
    assert found.possible
    R, K = found.resistance, found.output_torque_constant
    assert (R.value, R.lower, R.upper) == pytest.approx((3.04, 2.75, 3.72), abs=0.005)
    assert (K.value, K.lower, K.upper) == pytest.approx((1.04, 1.02, 1.12), abs=0.005)
    assert found.drop_voltage == 0.4
    assert not found.efficiency_from_sheet
    assert found.current_from_sheet


def test_one_voltage_with_both_currents_leaves_nothing_but_the_drop_open():
    found = motor_range(sheet(HS_311[1]))
    for drop, end in ((0.4, "lower"), (0.0, "upper")):
        motor = motor_from_sheet(supply_voltage=6.0, stall_torque=0.3432, no_load_speed=math.pi / 3 / 0.15,
                                 no_load_current=0.18, stall_current=0.8, drop_voltage=drop)
        assert getattr(found.resistance, end) == pytest.approx(motor.resistance)
        assert getattr(found.output_torque_constant, end) == pytest.approx(motor.output_torque_constant)
    assert found.efficiency_from_sheet
    assert found.no_load_current.lower == pytest.approx(0.18)
    assert found.no_load_current.upper == pytest.approx(0.18)


@pytest.mark.parametrize("voltages", [(6.0,), (4.8, 6.0), (4.8, 6.0, 7.4)])
@pytest.mark.parametrize("kept", [{}, {"no_load_current": True, "stall_current": False}], ids=["both", "running"])
def test_a_motor_is_found_again_from_its_own_sheet(voltages, kept):
    """Printed with η_g = 0.8 and V_d = 0.4, which is what is assumed where the sheet does not say."""
    R, K, eta, I_0 = 3.1, 1.03, 0.8, 0.25
    found = motor_range(sheet(*(printed(V, R, K, eta, I_0, 0.4, **kept) for V in voltages)))
    assert found.possible
    assert found.resistance.value == pytest.approx(R, rel=1e-6)
    assert found.output_torque_constant.value == pytest.approx(K, rel=1e-6)
    assert found.gear_efficiency.value == pytest.approx(eta, rel=1e-6)
    assert found.no_load_current.value == pytest.approx(I_0, rel=1e-6)
    mu = (1 - eta) / (1 + eta)
    assert found.coulomb_torque.value == pytest.approx(K * I_0 * (1 - mu), rel=1e-6)
    assert found.no_load_torque.value == pytest.approx(K * I_0, rel=1e-6)


def test_without_any_current_the_assumed_ratio_makes_it():
    """R = η U² (1 − ρ)²/(T_s ω_0) and K_out = U (1 − ρ)/ω_0."""
    found = motor_range(sheet(point(6.0, 0.4021, 0.19)))
    U, w, rho = 5.6, math.pi / 3 / 0.19, 0.12
    assert found.resistance.value == pytest.approx(0.8 * (U * (1 - rho)) ** 2 / (0.4021 * w))
    assert found.output_torque_constant.value == pytest.approx(U * (1 - rho) / w)
    assert found.no_load_current.value == pytest.approx(rho * U / found.resistance.value)
    assert not found.current_from_sheet


@pytest.mark.parametrize("points", [
    (HS_755HB[1],), HS_755HB, (HS_311[1],), HS_311, (point(6.0, 0.4021, 0.19),),
    (point(4.8, 0.3138, 0.23), point(6.0, 0.4021, 0.19)), (point(6.0, 0.3432, 0.14, None, 0.6),),
], ids=["755-6V", "755", "311-6V", "311", "no-current-6V", "no-current", "stall-only"])
def test_ranges_hold_everything_between_the_ends_that_were_tried(points):
    """The ends are enough: no draw from inside the assumed ranges, at any of the voltages, leaves them."""
    found = motor_range(sheet(*points))
    rng = np.random.default_rng(5)
    seen = 0
    for _ in range(300):
        p = points[rng.integers(len(points))]
        drop, eta, rho = rng.uniform(0.0, 0.4), rng.uniform(0.7, 0.9), rng.uniform(0.04, 0.3)
        I_0 = p.no_load_current
        if I_0 is None:
            U = p.supply_voltage - drop
            I_0 = rho * (p.stall_current or p.stall_torque * p.no_load_speed / (eta * U * (1 - rho) ** 2))
        motor = motor_from_sheet(supply_voltage=p.supply_voltage, stall_torque=p.stall_torque,
                                 no_load_speed=p.no_load_speed, no_load_current=I_0, stall_current=p.stall_current,
                                 drop_voltage=drop, gear_efficiency=eta)
        if not motor.feasible:
            continue
        seen += 1
        for name in ("resistance", "output_torque_constant", "gear_efficiency", "coulomb_torque"):
            r, x = getattr(found, name), getattr(motor, name)
            # the border of what is possible is found to a step of what is tried
            slack = 0.1 if p.stall_current and p.no_load_current is None else 1e-9
            assert r.lower * (1 - slack) <= x <= r.upper * (1 + slack), name
    assert seen > 100


def test_every_value_lies_in_its_range():
    for points in (HS_755HB, HS_311, (point(6.0, 0.4, 0.19),)):
        found = motor_range(sheet(*points))
        for name in NAMES:
            r = getattr(found, name)
            assert r.lower <= r.value <= r.upper, name


def test_two_voltages_are_fitted_together_and_their_difference_is_range():
    alone = [motor_range(sheet(p)) for p in HS_755HB]
    both = motor_range(sheet(*HS_755HB))
    for name in ("resistance", "output_torque_constant"):
        values = sorted(getattr(one, name).value for one in alone)
        assert values[0] < getattr(both, name).value < values[1]
        assert getattr(both, name).lower == pytest.approx(min(getattr(one, name).lower for one in alone))
        assert getattr(both, name).upper == pytest.approx(max(getattr(one, name).upper for one in alone))


def test_the_fit_of_two_voltages_is_a_minimum():
    """Squares of the logarithms of printed over computed torque, speed and stall current."""
    both = motor_range(sheet(*HS_311))

    def squares(R, K, eta):
        total = 0.0
        for p in HS_311:
            U = p.supply_voltage - both.drop_voltage
            total += math.log((U - R * p.no_load_current) / (K * p.no_load_speed)) ** 2
            total += math.log(eta * K * (U / R - p.no_load_current) / p.stall_torque) ** 2
            total += math.log(U / (R * p.stall_current)) ** 2
        return total

    at = (both.resistance.value, both.output_torque_constant.value, both.gear_efficiency.value)
    for k in range(3):
        for by in (0.999, 1.001):
            moved = [x * (by if i == k else 1.0) for i, x in enumerate(at)]
            assert squares(*moved) > squares(*at)


def test_a_current_of_one_voltage_serves_the_other():
    found = motor_range(sheet(printed(4.8, 3.0, 1.0, 0.8, 0.2, 0.4, no_load_current=False, stall_current=False),
                              printed(6.0, 3.0, 1.0, 0.8, 0.2, 0.4)))
    assert found.resistance.value == pytest.approx(3.0, rel=1e-6)
    assert found.gear_efficiency.value == pytest.approx(0.8, rel=1e-6)


def test_a_lower_drop_is_taken_where_the_usual_one_leaves_no_possible_gear():
    found = motor_range(sheet(point(4.8, 0.3923, 0.055, 0.19, 2.0)))
    assert found.possible
    assert 0.0 < found.drop_voltage < 0.4
    assert found.gear_efficiency.value <= 1.0


def test_another_source_widens_the_range_and_moves_nothing():
    one = point(6.0, 0.403, 0.16, 0.15)
    alone, both = (motor_range(sheet(*points)) for points in (
        (one,), (one, point(6.0, 0.4903, 0.14, 0.15, source="a forum"))))
    for name in NAMES:
        a, b = getattr(alone, name), getattr(both, name)
        assert b.value == a.value
        assert b.lower <= a.lower
        assert b.upper >= a.upper
    assert both.resistance.lower < alone.resistance.lower


@pytest.mark.parametrize(("change", "named"), [
    ({"stall_torque": math.nan}, "stall torque at 6 V"), ({"stall_torque": -1.0}, "stall torque at 6 V"),
    ({"stall_torque": 1294.5}, "stall torque at 6 V"), ({"no_load_speed": math.inf}, "no load speed at 6 V"),
    ({"supply_voltage": 0.0}, "supply voltage"), ({"supply_voltage": "6 V"}, "supply voltage"),
    ({"no_load_current": 285.0}, "no load current"), ({"stall_current": 0.2}, "stall current at 6 V"),
])
def test_bad_figures_are_refused_in_one_line(change, named):
    facts = {"supply_voltage": 6.0, "stall_torque": 1.2945, "no_load_speed": 4.55, "no_load_current": 0.285}
    with pytest.raises(InputError, match=named) as caught:
        SheetPoint(**(facts | change))
    assert caught.value.allowed
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("main", [(6.0,), (4.8, 6.0)])
@pytest.mark.parametrize(("name", "at"), [("stall_current", 7.2), ("no_load_current", 7.2)])
def test_a_current_at_a_voltage_without_torque_and_speed_counts(main, name, at):
    """A known motor: what its sheet prints of the other current is given at one more voltage only."""
    motor = {"R": 3.0, "K": 0.9, "eta": 0.8, "I_0": 0.2, "drop": 0.4}
    alone = printed(at, **motor)
    points = [printed(V, **motor, **{name: False}) for V in main]
    found = motor_range(sheet(*points, SheetPoint(supply_voltage=at, **{name: getattr(alone, name)})))
    for field, value in (("resistance", 3.0), ("output_torque_constant", 0.9), ("gear_efficiency", 0.8),
                         ("no_load_current", 0.2)):
        assert getattr(found, field).value == pytest.approx(value, rel=1e-6)


def test_a_stall_current_elsewhere_that_cannot_be_is_found():
    found = sheet_contradictions(sheet(HS_755HB[1], point(4.8, I_s=0.4)))
    assert "at 4.8 V and 6 V" in found[0].text


@pytest.mark.parametrize(("points", "said"), [
    ((point(6.0, 1.0),), "torque without speed"), ((point(6.0, None, 0.2),), "speed without torque"),
    ((point(4.8, 1.0), point(6.0, None, 0.2)), "torque and speed at different voltages"),
    ((point(6.0, None, None, 0.2),), "neither"), ((), "neither"),
])
def test_a_sheet_needs_torque_and_speed_together(points, said):
    with pytest.raises(InputError, match=said):
        sheet(*points)


@pytest.mark.parametrize(("facts", "said"), [
    ({"name": "my servo"}, "name of a servo"), ({"name": "../x"}, "name of a servo"), ({"name": ""}, "name of a servo"),
    ({"deadband": 8.0}, "deadband"), ({"pulse_min": 1e-3}, "pulse range"),
    ({"pulse_min": 2e-3, "pulse_max": 1e-3}, "pulse range"), ({"travel": -1.0}, "travel"), ({"mass": 110.0}, "mass"),
    ({"gear_reduction": 0.5}, "gear reduction"), ({"modulation": "fm"}, "modulation"), ({"backlash": 1.0}, "backlash"),
    ({"pulse_min": 1e-3, "pulse_max": 2e-3, "neutral_pulse": 2.5e-3}, "neutral pulse"),
])
def test_bad_facts_are_refused_in_one_line(facts, said):
    with pytest.raises(InputError, match=said) as caught:
        Sheet(**({"name": "mine", "points": HS_311} | facts))
    assert "\n" not in str(caught.value)


def test_the_nominal_point_is_that_nearest_6_volts_unless_one_is_chosen():
    points = (point(4.8, 0.39, 0.055), point(5.0, 0.4, 0.05), point(7.4, 0.53, 0.035))
    assert sheet(*points).nominal.supply_voltage == 5.0
    assert sheet(*points).at(7.4).nominal.supply_voltage == 7.4
    with pytest.raises(InputError, match=r"4\.8, 5, 7\.4 V"):
        sheet(*points).at(6.0)

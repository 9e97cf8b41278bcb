"""One voltage, or one scale of the loads, behind several contradictions of a servo file."""

import math

import pytest

from identification.fits import FREE, fitted, some
from identification.synthetic_logs import TRUTH
from servotwin.identification.fitting.search.free import nominal
from servotwin.identification.fitting.validate import Agreeing, common_cause


def items(powers, factor, spread=0.02):
    return [Agreeing(name, 2.0, 2.0 * spread, 2.0 * factor**power, 2.0 * spread) for name, power in powers.items()]


VOLTAGE = {"motor.armature_resistance": -2.0, "output_torque_constant": -1.0}
LOAD = {"motor.armature_resistance": 1.0, "output_inertia": -1.0, "output_coulomb_torque": -1.0}


def test_each_cause_is_told_from_the_other():
    assert "a supply of 4.8 V instead of 6 V would explain both" in common_cause(items(VOLTAGE, 0.8), voltage=6.0)
    assert "loads 1.3 times as large as the logs say would explain all three" in common_cause(
        items(LOAD, 1.3), voltage=6.0)
    angle = items({"potentiometer.feedback_gain": -1.0, "output_torque_constant": -1.0, "output_inertia": -2.0}, 1.1)
    for seen in (angle, angle[:1]):
        assert "the angle is scaled by 1.1," in common_cause(seen, voltage=6.0)
    assert common_cause(angle[1:], voltage=6.0) is None
    with_drop = common_cause(items(VOLTAGE, 0.5), voltage=6.0, drop_voltage=0.4)
    assert "a supply of 3.2 V" in with_drop


@pytest.mark.parametrize("given", [
    items(VOLTAGE, 0.8)[:1], [], items({"motor.armature_resistance": 2.0, "output_torque_constant": -1.0}, 1.3),
    items({**VOLTAGE, "electronics.deadband": 1.0}, 0.8),
    [*items(VOLTAGE, 0.8), Agreeing("output_inertia", 1.0, 0.1, 0.5, math.nan)],
], ids=["one", "none", "against each other", "another number", "undetermined"])
def test_what_no_one_cause_explains(given):
    assert common_cause(given, voltage=6.0) is None


def test_what_agrees_with_the_file_must_go_on_doing_so():
    inertia, = items({"output_inertia": 0.0}, 1.0)
    both = items({"output_coulomb_torque": -1.0, "motor.armature_resistance": 1.0}, 1.5)
    assert common_cause(both, voltage=6.0) is not None
    assert common_cause(both, [inertia], voltage=6.0) is None


@pytest.mark.slow
@pytest.mark.parametrize(("change", "word"), [({"supply.open_circuit_voltage": 5.1}, "a supply of 5.1 V"),
                                              ({"load": 1.25}, "loads 1.2")], ids=["voltage", "load"])
def test_a_fit_with_a_wrong_voltage_or_load_finds_these_powers(change, word):
    """The truth runs at 5.1 V, or with a load 1.25 times what the logs say: the fit alone says which."""
    from dataclasses import replace

    import servotwin as st
    from identification.fits import DISC

    factor = change.pop("load", 1.0)
    load = st.loads.Inertia(1.06e-2 * factor) + st.loads.Constant(0.3 * factor)
    servo = TRUTH.replace({**change, "supply.bridge_drop_voltage": 0.0})
    logs = [replace(log, load=DISC) for log in some(servo, load=load)]
    fit = fitted(logs, servo=TRUTH.replace({"supply.bridge_drop_voltage": 0.0}), free=FREE)
    found = [Agreeing(name, nominal(TRUTH, name), 0.02 * nominal(TRUTH, name), fit.estimates[name],
                      0.01 * fit.estimates[name]) for name in FREE[:4]]
    away = [one for one in found if abs(math.log(one.logs / one.file)) > 0.05]
    assert word in common_cause(away, [one for one in found if one not in away], voltage=6.0)

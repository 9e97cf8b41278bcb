"""Which kernels servos take, and which way digital ones go in them: as it was written down when forms were chosen by
the names of terms.

How long many servos take hangs on it, and what has to be compiled at all.
"""

from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

import servotwin as st
from servotwin.models.engine.legs.tick_legs import LEGS, POWER_SERIES
from servotwin.models.engine.memory import NOT_ASKED
from servotwin.models.engine.motions.choice import may_depend
from servotwin.models.engine.run import runs
from servotwin.models.state.records import mapped
from servotwin.models.terms.dependence import RECORDED, TABLE
from servotwin.models.terms.firmware import NO_FIRMWARE
from servotwin.models.terms.frame import NO_CHIP
from servotwin.physics.pieces import Piece
from servotwin.simulation.lanes import forms
from servotwin.simulation.lanes.forms import DIGITAL
from servotwin.simulation.lanes.packed import by_groups

NOBODY = np.zeros(1, np.bool_)
PULSED = (st.PulseServo, st.PulseServoInductive)
PROGRAM = {"firmware.control_period": 2e-3, "firmware.proportional_gain": 9.0}
MEAN = {"electronics.bridge_gain": 40.0, "electronics.comparator_gain": 1.0, "electronics.pulse_to_voltage_gain": 735.0,
        "electronics.command_offset": 0.1}
FEATURES = {  # what the servo has, or a load
    "play": {"gear.backlash": 0.01, "gear.output_inertia": 1e-3},
    "spring": {"gear.stiffness": 30.0, "gear.output_inertia": 1e-3},
    "coil": {"motor.armature_inductance": 5e-4},
    "heat": {"thermal.winding_capacity": 5.0, "thermal.housing_capacity": 50.0, "thermal.winding_to_housing": 5.0,
             "thermal.housing_to_ambient": 20.0},
    "limit": {"supply.current_limit": 1.0},
    "creep": {"friction.breakaway_ratio": 1.4, "friction.stribeck_speed": 5.0},
    "share": {"friction.load_friction": 0.05},
    "locks": {"friction.load_friction_motor": 1.2},
    "slack": {"potentiometer.backlash": 0.01},
    "steps": {"potentiometer.quantisation": 1e-3},
    "bend": {"potentiometer.linearity_angle": [0.0, 1.0, 2.0], "potentiometer.linearity_error": [0.0, 0.01, -0.01]},
    "coast": {"electronics.off_state": "coast"},
    "silent": {"electronics.silence_state": "coast"},
    "hangs": st.loads.Pendulum(mass=0.1, length=0.1),
    "held": st.loads.Spring(stiffness=0.1, rest_angle=0.3),
    "told": st.loads.Recorded([0.0, 9.0], [0.01, 0.02]),
}
NO_LOAD = st.loads.Inertia(1e-4) + st.loads.Constant(0.01)
OF_PULSES = ("coil", "silent", "coast")

# Sets of features by the kernels that servos took; what is not here took the general ones, a spring those of its own
OF_ANALOG = {
    "side_by_side_float64": "plain slack",
    "by_gaps": "play play+limit play+share play+slack play+coast play+heat",
    "by_coils": "coil coil+slack coil+coast coil+share",
    "by_strides": (
        "heat hangs held heat+slack heat+coast heat+hangs heat+held slack+hangs slack+held coast+hangs coast+held "
        "hangs+held heat+limit heat+creep heat+share limit+hangs limit+held creep+hangs creep+held share+hangs "
        "share+held"),
    "by_bands": (
        "coast coast+silent limit share limit+share limit+slack limit+coast share+slack share+coast slack+coast creep "
        "limit+creep creep+share creep+slack creep+coast"),
}
OF_DIGITAL = {
    "digital, by legs": (  # the plain one has drops
        "plain play share steps bend play+share play+steps play+bend share+steps share+bend steps+bend"),
    "digital, by series": "heat limit play+heat play+limit heat+limit heat+share heat+steps limit+share limit+steps",
}
OF_CATALOG = {
    "by_bands": (
        "dfrobot-df05bb dfrobot-dss-m15s emax-es08a emax-es08ma feetech-fs5103b futaba-s148 futaba-s3001 "
        "futaba-s3004 futaba-s3305 gobilda-2000-135 gobilda-2000-67 gws-micro-2bbmg hextronik-hxt900 hitec-hs-300 "
        "hitec-hs-322hd hitec-hs-325hb hitec-hs-422 hitec-hs-425bb hitec-hs-475hb hitec-hs-485hb hitec-hs-55 "
        "hitec-hs-645mg hitec-hs-755mg hitec-hs-805bb hitec-hs-81 hitec-hs-85bb power-hd-hd-1501mg "
        "unbranded-micro-13g"),
    "by_ticks": "dsservo-ds3218 dsservo-rds3115 dynamixel-xl330-m077 feetech-ft-7235 towerpro-mg995",
    "digital, by legs": (
        "dynamixel-2xl430-w250 dynamixel-ax-12a dynamixel-mx-106 dynamixel-mx-28 dynamixel-mx-64 dynamixel-xc330-t288 "
        "dynamixel-xc430-w240 dynamixel-xl-320 dynamixel-xl330-m288 dynamixel-xl430-w250 dynamixel-xm430-w210 "
        "dynamixel-xm430-w350 emax-es08md feetech-ft-15m0 feetech-ft-2806 feetech-sts3215-12v feetech-sts3215-7v4 "
        "feetech-sts3250 hitec-hs-5485hb jx-pdi-6221mg miuzei-25kg towerpro-mg996r towerpro-sg92r"),
    "by_gaps": "geekservo-2kg miuzei-ms18",
    "side_by_side_float64": "futaba-s3003 hitec-hs-311 hitec-hs-755hb towerpro-mg90s towerpro-sg90",
}


def form_of(model, load=NO_LOAD, dtype="float64", told=False, bent=False):
    """Return the name of the kernels that a servo takes as a lane."""
    pulsed, numbers, program = isinstance(model, PULSED), model.pack(load), model.firmware() or NO_FIRMWARE
    (kind,) = forms.kinds_with(
        numbers, model.chip() if pulsed else NO_CHIP, 1, dtype, NOBODY, NOBODY | told, bent, program)
    if kind.recipe != DIGITAL:
        return kind.recipe.name
    inputs = SimpleNamespace(torque=[()] * told, curve=[()] * bent, firmware=(program,))
    for way, part, asked in ((LEGS, "legs", False), (LEGS, "legs", True), (POWER_SERIES, "series", False)):
        if runs.way_of(numbers, inputs, SimpleNamespace(lowest=NOT_ASKED), 1.0, asked) == way:
            (own,) = (one for one in DIGITAL.parts if one.name == part)
            demands = forms.Terms(numbers, NO_CHIP, program, inputs=TABLE * bent | RECORDED * told)
            assert demands.suit(own.knows | own.leaves), part  # what its kernels leave out is not asked for
            if not asked:
                return f"{kind.recipe.name}, by {part}"
    return kind.recipe.name


def varied(servo, rng):
    """Return a servo whose motor is up to a tenth off."""
    return servo.replace({name: servo.get(name) * rng.uniform(0.9, 1.1) for name in servo.names()
                          if name.startswith("motor.")})


def combined(kind, servo, names, dtype, rng):
    """Return the form that a servo takes with some features."""
    own = {}
    for name in names:
        own |= FEATURES[name] if isinstance(FEATURES[name], dict) else {}
    load = NO_LOAD
    for name in names:
        load = load + FEATURES[name] if not isinstance(FEATURES[name], dict) else load
    if "coil" in names:
        kind = st.PulseServoInductive
    return form_of(kind(varied(servo.replace(own), rng)), load, dtype, "told" in names, "bend" in names)


def expected(table, names, general="runs"):
    """Return what is written down for a set of features, or the general form."""
    if "spring" in names:
        return general
    told = "+".join(names) or "plain"
    return next((form for form, sets in table.items() if told in sets.split()), general)


def pairs(without=()):
    """Return all sets of up to two features that a servo may have."""
    own = [name for name in FEATURES if name not in without]
    return [names for count in range(3) for names in combinations(own, count) if names != ("share", "locks")]


@pytest.mark.long
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_analog_servos_take_the_forms_that_they_took(servo, dtype):
    rng = np.random.default_rng(3)
    for names in pairs():
        form = expected(OF_ANALOG, names).replace("side_by_side_float64", f"side_by_side_{dtype}")
        assert combined(st.PulseServo, servo, names, dtype, rng) == form, names


def test_servos_without_pulses_take_the_forms_that_they_took(servo):
    rng = np.random.default_rng(3)
    for names in pairs(("coil", "silent")):  # only a load's are terms of theirs
        assert combined(st.BoundedServo, servo.replace(MEAN), names, "float64", rng) == "runs", names


@pytest.mark.long
def test_digital_servos_take_the_forms_that_they_took(servo):
    rng = np.random.default_rng(3)
    for names in pairs(OF_PULSES):
        form = expected(OF_DIGITAL, names, "digital")
        assert combined(st.DigitalServo, servo.replace(PROGRAM), names, "float64", rng) == form, names


@pytest.mark.long
def test_servos_of_the_catalog_take_the_forms_that_they_took():
    known = {name: form for form, names in OF_CATALOG.items() for name in names.split()}
    for name in st.catalog_names():
        servo = st.load_servo(name)
        analog = servo.kind == "analog"
        found = form_of((st.PulseServo if analog else st.DigitalServo)(servo))
        assert found == known.get(name, "runs" if analog else "digital"), name


@pytest.mark.long
def test_no_servo_of_today_needs_kernels_that_are_not_made_beforehand(servo):
    """They are there for terms to come that the others do not know."""
    rng = np.random.default_rng(4)
    own = [name for name in FEATURES if name not in (*OF_PULSES, "share")]
    catalog = [st.load_servo(name) for name in st.catalog_names()]
    programs = [servo.replace(PROGRAM), *(
        one for one in catalog if one.kind != "analog" and "friction.load_friction" not in one.names())]
    for _ in range(150):
        names = rng.permutation(own)[:rng.integers(3, 7)].tolist()
        digital = programs[rng.integers(len(programs))]
        assert combined(st.DigitalServo, digital, names, "float64", rng) in (
            "by_ticks", "digital, by legs", "digital"), names


def test_many_lanes_are_asked_what_each_of_them_is(servo):
    rng, lanes = np.random.default_rng(5), 30
    plain = st.PulseServo(servo).pack(NO_LOAD)

    def column(value):
        return np.where(rng.random(lanes) < 0.5, rng.choice([0.0, 0.5, 1.0, 2.0], lanes), value)

    for _ in range(20):
        numbers = mapped(lambda value: column(value) if rng.random() < 0.3 else value, plain)
        found = by_groups(may_depend, lanes, numbers, Piece())
        for k in range(lanes):
            own = mapped(lambda value, k=k: value[k].item() if isinstance(value, np.ndarray) else value, numbers)
            assert np.broadcast_to(found, lanes)[k] == may_depend(own, Piece())


def test_a_batch_and_a_simulator_say_by_which_kernels_each_lane_runs(servo):
    """Of plain lanes and one with load friction, with and without a shared supply."""
    parameters = {"friction.load_friction": [0.0, 0.05, 0.0], "load.inertia": 1e-4}
    model, command = st.PulseServo(servo), st.signals.constant(30.0, unit="deg")
    batch = st.simulate_many(model, command, duration=0.05, parameters=parameters)
    plain = "side_by_side_float64"
    assert batch.stats.kernel.tolist() == [plain, "by_bands", plain]
    sims = st.VectorSimulator(model, lanes=3, parameters=parameters)
    assert sims.kernels.tolist() == [plain, "by_bands", plain]
    both = st.VectorSimulator(model, lanes=3, bus=[(st.Supply(open_circuit_voltage=6.0, internal_resistance=0.2),
                                                    [0, 2])])
    assert both.kernels.tolist() == ["buses", plain, "buses"]

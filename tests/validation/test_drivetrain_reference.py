"""Every effect of the drive train against the independent reference: random servos, each effect alone and mixed.

Measured over 52 servos of each effect: the angles part by 4e-13 rad at most where every motion is closed form (4e-12
with inductance, 5e-15 where the reference takes shorter steps), and by 1e-10 rad where some are integrated.
"""

import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import plain_run
import servotwin as st
from reference.drivetrain import Trace, simulate_case
from reference.drivetrain_cases import TERMS, Case, command_of, load_of, random_case, servo_of

INTEGRATED = {"stribeck", "m3", "m4", "m5", "m6", "backlash", "heat", "pendulum"}
ANGLE = {True: 1e-10, False: 1e-8}  # rad; in closed form?
FEW, MANY = 3, 40  # servos of each effect
SHORT = 0.25  # s; of the few
COARSE = {"max_step": 4e-3, "samples": 6}  # of the reference: half the time for the same angles

MIXTURES = [
    {"inductance", "coast", "stops"},
    {"inductance", "limit", "coulomb", "wiper", "table", "quantisation"},
    {"limit", "coast", "coulomb", "stops", "quantisation"},
    {"spring", "stops", "coulomb", "wiper", "table"},
    {"stribeck", "m4", "pendulum", "stops"},
    {"stribeck", "m6", "coast", "limit"},
    {"m5", "heat", "spring", "coulomb"},
    {"heat", "inductance", "pendulum"},
    {"backlash", "coulomb", "wiper", "stops"},
    {"backlash", "inductance", "coast", "limit"},
    {"stribeck", "m6", "backlash", "heat", "limit", "pendulum"},
    {"inductance", "stribeck", "m5", "heat", "stops", "coast", "spring"},
    set(TERMS) - {"m3", "m4", "m5"},
]


def simulate(case: Case, times: np.ndarray, by: Callable[..., st.Result] = st.simulate, **options: object) -> st.Result:
    """A case of the reference, run by the package; one without edges gets its first pulse after its end."""
    model = (st.PulseServoInductive if case.inductive else st.PulseServo)(servo_of(case))
    late = st.signals.pulse_train([case.duration + 1.0], [case.command.before], unit="s")
    return by(model, late if case.edges == () else command_of(case), duration=case.duration, load=load_of(case),
              output_times=times, initial=dict(case.initial), **options).raise_if_failed()


def on_a_knife_edge(trace: Trace) -> bool:
    """Whether a frame's decision, or a count of the potentiometer, hangs on less than rounding may move [s], [V]."""
    return trace.margin < 1e-14 or trace.tie < 1e-11


def deviations(case: Case, result: st.Result, trace: Trace) -> dict[str, float]:
    """Largest deviations by name, each over what an angle that is 1 rad off may make of it.

    Angles and temperatures are continuous; all else is compared where no event is near. Within its steps the reference
    interpolates, which a fast current feels most.
    """
    N, clear = case.values["gear.gear_reduction"], ~trace.near_event(trace.times)
    everywhere = {"output_angle": (trace.output_angle, 1.0), "motor_angle": (trace.motor_angle, N)}
    if "thermal.ambient" in case.values:
        everywhere |= {"winding_temperature": (trace.winding_temperature, 1e3),
                       "housing_temperature": (trace.housing_temperature, 1e3)}
    between = {"output_speed": (trace.output_speed, 1e3), "motor_speed": (trace.motor_speed, 1e3 * N),
               "armature_current": (trace.armature_current, 1e4), "bus_voltage": (trace.bus_voltage, 1e3),
               "error_time": (trace.error_time, 1e-3), "drive": (trace.drive, 1e-6)}
    found = {name: np.max(np.abs(result[name] - want)) / scale for name, (want, scale) in everywhere.items()}
    found["wiper"] = np.max(np.abs(result.trajectory.at(trace.times).wiper - trace.wiper_angle))
    for name, (want, scale) in between.items():
        found[name] = np.max(np.abs(result[name] - want)[clear], initial=0.0) / scale
    return found


def left_out(cases: list[Case], tolerance: float, *, plain: bool = False) -> int:
    """Compare the cases, in plain Python too; return how many knife edges there were among them."""
    skipped = 0
    for case in cases:
        times = np.linspace(0.0, case.duration, 41)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # random calibrations differ by design
            result = simulate(case, times)
            if plain:
                plain_run.is_the_same(result, simulate(case, times, by=plain_run.simulate))
        trace = simulate_case(case, times, **COARSE)
        if on_a_knife_edge(trace):
            skipped += 1
            continue
        off = {name: size for name, size in deviations(case, result, trace).items() if not size <= tolerance}
        assert not off, f"{off}, {result.stats.method}: {case}"
    return skipped


def tolerance_of(terms: set[str]) -> float:
    return ANGLE[not terms & INTEGRATED]


@pytest.mark.long(but="spring")
@pytest.mark.parametrize("term", sorted(TERMS))
def test_each_effect(term):
    cases = [random_case(seed, frozenset({term})) for seed in range(FEW)]
    assert left_out([replace(case, duration=SHORT) for case in cases], tolerance_of({term}), plain=True) == 0


@pytest.mark.slow
@pytest.mark.parametrize("term", sorted(TERMS))
def test_each_effect_in_many_servos(term):
    assert left_out([random_case(seed, frozenset({term})) for seed in range(FEW, MANY)], tolerance_of({term})) <= 1


@pytest.mark.long(but="backlash+heat+limit+m6+pendulum+stribeck")
@pytest.mark.parametrize("terms", MIXTURES, ids=lambda terms: "+".join(sorted(terms)))
def test_effects_mixed(terms):
    case = replace(random_case(100, frozenset(terms)), duration=SHORT)
    assert left_out([case], tolerance_of(terms), plain=True) == 0


@pytest.mark.slow
@pytest.mark.parametrize("terms", MIXTURES, ids=lambda terms: "+".join(sorted(terms)))
def test_effects_mixed_in_many_servos(terms):
    assert left_out([random_case(seed, frozenset(terms)) for seed in range(101, 107)], tolerance_of(terms)) <= 1


@pytest.mark.long
def test_a_motor_that_hits_an_output_on_its_way_into_a_stop():
    """Whatever it is followed by hangs on how the impacts between motor and stop end."""
    case = random_case(245, frozenset({"m3", "heat", "backlash", "stops", "limit"}))
    assert left_out([replace(case, duration=0.13)], tolerance_of({"backlash"}), plain=True) == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [*range(2000, 2016), 2030, 2033, 2056, 2071, 2078, 2109, 2138, 2149])
def test_any_half_of_the_effects(seed):
    """The last seeds are there because they once found mistakes: blows on an output that rests on a stop above all."""
    numbers = np.random.default_rng(seed)
    terms = frozenset(term for term in sorted(TERMS) if numbers.random() < 0.5)
    assert left_out([replace(random_case(seed, terms), duration=SHORT)], tolerance_of({"backlash"})) == 0


@pytest.mark.long(but="16")
@pytest.mark.parametrize("seed", [11, 16])
def test_a_step_that_is_tried_far_too_long_is_only_tried(seed):
    """After a rest the integrator tries a hundred times L/R; current, heat and angle then leave all numbers behind."""
    terms = {"heat", "inductance", "pendulum"}
    assert left_out([replace(random_case(seed, frozenset(terms)), duration=0.1)], tolerance_of(terms)) == 0


@pytest.mark.long
def test_an_output_that_goes_to_and_fro_between_motor_and_stop_comes_to_rest():
    """Its blows, ever smaller, came one after the other without time between, so that the run ended there."""
    terms = {"backlash", "heat", "inductance", "m6", "spring", "stops", "stribeck", "table", "wiper"}
    assert left_out([replace(random_case(7, frozenset(terms)), duration=0.1)], tolerance_of(terms)) == 0

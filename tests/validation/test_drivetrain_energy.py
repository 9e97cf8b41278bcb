"""Energy closes with every term on, and the angle is the integral of the speed."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from conftest import EVERYTHING
from reference.drivetrain import ENERGIES, simulate_case
from reference.drivetrain_cases import TERMS, random_case
from validation.test_drivetrain_reference import MIXTURES, simulate

STEP = st.signals.step(20.0, 65.0, at=0.02, unit="deg")
SINE = st.signals.sine(mean=42.0, amplitude=24.0, frequency=4.0, unit="deg")
LOAD = (st.loads.Inertia(2e-3) + st.loads.Viscous(1e-3) + st.loads.Coulomb(0.02) + st.loads.Constant(0.1)
        + st.loads.Spring(0.1, 0.5) + st.loads.Pendulum(mass=0.1, length=0.1))
STOPS = {"stops.lower_angle": 0.3, "stops.upper_angle": 1.16, "stops.restitution": 0.5}


def check(result):
    """The balance, to 1e-9 of what was turned over, and no loss that gives."""
    energy = result.energy
    turnover = abs(energy.supply) + energy.winding + energy.friction + abs(energy.load) + abs(energy.stored)
    assert turnover > 1e-3
    assert abs(energy.residual) <= 1e-9 * turnover
    assert min(energy.winding, energy.bridge, energy.brush) >= 0.0
    assert energy.friction >= -1e-12
    assert energy.stops >= -1e-13 * turnover  # of rounding, of times too


@pytest.mark.long(but="None-coast-sine")
@pytest.mark.parametrize("command", [STEP, SINE], ids=["step", "sine"])
@pytest.mark.parametrize("off", ["brake", "coast"])
@pytest.mark.parametrize("inductance", [None, 4e-4])
def test_with_every_term_on(servo, command, off, inductance):
    worn = servo.replace(EVERYTHING | STOPS | {
        "electronics.off_state": off, "motor.brush_drop_voltage": 0.2, "motor.armature_inductance": inductance,
        "electronics.back_emf_injection": 1e-3, "electronics.supply_coupling": 2e-3, "potentiometer.noise": 1e-3})
    model = st.PulseServo(worn) if inductance is None else st.PulseServoInductive(worn)
    check(st.simulate(model, command, duration=0.2, load=LOAD, seed=3).raise_if_failed())


@pytest.mark.long(but="coast+inductance+stops")
@pytest.mark.parametrize("terms", [*MIXTURES, {"backlash"}, {"backlash", "coast", "coulomb", "limit", "stops"}],
                         ids=lambda terms: "+".join(sorted(terms)))
def test_in_mixtures(terms):
    case = replace(random_case(300, frozenset(terms)), duration=0.15)
    check(simulate(case, np.array([case.duration])))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_in_many_mixtures(seed):
    rng = np.random.default_rng(seed)
    terms = frozenset(term for term in sorted(TERMS) if rng.random() < 0.5)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # random calibrations differ by design
        check(simulate(random_case(400 + seed, terms), np.array([0.2])))


def test_it_is_the_energy_of_the_reference():
    """Each share of it, of a run that has all of them."""
    case = replace(random_case(1, frozenset(TERMS - {"inductance"})), duration=0.15)
    own, other = simulate(case, np.array([0.15])).energy, simulate_case(case, [0.15]).energy
    turnover = abs(own.supply) + own.winding + own.friction + abs(own.load)
    for name in (*ENERGIES, "stops", "stored"):
        mine = own.conversion if name == "converter" else getattr(own, name)
        assert mine == pytest.approx(other[name], abs=1e-8 * turnover), name


# --- angle and speed --------------------------------------------------------------------------------------------------


@pytest.mark.long(but="heat")
@pytest.mark.parametrize("terms", [{"stribeck"}, {"m6", "stribeck"}, {"heat"}, {"backlash"}, {"pendulum"},
                                   {"inductance", "backlash", "heat"}], ids=lambda terms: "+".join(sorted(terms)))
def test_the_angle_is_the_integral_of_the_speed(terms):
    """Between any two samples, within the steps of an integrated run too; of the motor as of the output."""
    case = replace(random_case(7, frozenset(terms)), duration=0.1)
    result = simulate(case, np.array([0.1]))
    assert ("integrated" in result.stats.method) == (terms != {"backlash"})
    times = np.sort(np.random.default_rng(0).uniform(0.0, 0.1, 40))
    cuts = np.unique([*times, *(segment.start for segment in result.trajectory.segments if segment.start > times[0])])
    cuts = cuts[cuts <= times[-1]]
    x, weight = np.polynomial.legendre.leggauss(8)
    half = 0.5 * np.diff(cuts)
    nodes = (cuts[:-1] + half)[:, None] + half[:, None] * x
    for shaft in ("output", "motor"):
        N = 1.0 if shaft == "output" else case.values["gear.gear_reduction"]
        way = (result.at(f"{shaft}_speed", nodes.ravel()).reshape(nodes.shape) * weight).sum(axis=1) * half / N
        angle = np.concatenate([[0.0], np.cumsum(way)])
        jumps = np.diff(result.at(f"{shaft}_angle", times)) / N
        np.testing.assert_allclose(np.diff(angle[np.searchsorted(cuts, times)]), jumps, rtol=0.0, atol=1e-10)

"""Play of the gear: momentum at the flanks, the dead time of a reversal, and when two bodies part."""

import math
from dataclasses import replace
from itertools import groupby

import numpy as np
import pytest
from scipy.optimize import brentq

import servotwin as st
from reference.drivetrain_cases import Command, random_case, servo_of
from reference.drivetrain_laws import make_plant
from servotwin.models.state.modes import INSIDE
from validation.test_drivetrain_armature import CENTRE, SIMPLE, N, driven, undriven
from validation.test_drivetrain_reference import simulate
from validation.test_drivetrain_stops import around

PLAY = 0.04  # rad
MOTOR, OUTPUT = 6e-3, 2e-3  # kg m²
LOOSE = {"gear.backlash": PLAY, "gear.output_inertia": OUTPUT}


# --- impact -----------------------------------------------------------------------------------------------------------


@pytest.mark.long(but="backlash+coast+inductance")
@pytest.mark.parametrize("terms", [{"backlash"}, {"backlash", "inductance", "coast"},
                                   {"backlash", "stribeck", "m6", "heat"}], ids=lambda terms: "+".join(sorted(terms)))
def test_momentum_is_kept_where_the_flanks_meet(terms):
    impacts = 0
    for seed in range(6):
        case = random_case(seed, frozenset(terms))
        P, half = make_plant(case.values, case.load), 0.5 * case.values["gear.backlash"]
        for before, after in around(simulate(case, np.array([case.duration])), "gear meets"):
            impacts += 1
            assert abs(before[5] - before[0]) == pytest.approx(half, abs=1e-12)
            assert (before[6] - before[1]) * (before[5] - before[0]) >= 0.0  # closing
            assert after[1] == after[6]
            assert P.J * after[1] == pytest.approx(P.J_L * before[1] + P.J_m * before[6], rel=1e-11, abs=1e-13)
            assert after[2:5] == pytest.approx(before[2:5], rel=1e-12, abs=1e-15)  # current and temperatures go on
            assert P.J * after[1] ** 2 <= P.J_L * before[1] ** 2 + P.J_m * before[6] ** 2 + 1e-15
    assert impacts > 15


@pytest.mark.parametrize("way", [1, -1])
def test_an_impact_in_closed_form(way):
    """A motor of 2 rad/s reaches the flank after 10 ms and takes the output along: w = 1.5 rad/s of 2."""
    w = way * 2.0 * MOTOR / (MOTOR + OUTPUT)
    # Open and without friction nothing else acts.
    case = undriven(LOOSE | {"electronics.off_state": "coast"},
                    initial={"output_angle": 1.0, "motor_angle": N, "motor_speed": way * 2.0 * N}, duration=0.05)
    result = simulate(case, np.array([0.005, 0.05]))
    assert [(event.kind, event.time) for event in result.events] == [("gear meets", pytest.approx(0.01, abs=1e-14))]
    np.testing.assert_allclose(result["output_angle"], [1.0, 1.0 + w * 0.04], rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(result["motor_angle"] / N,
                               [1.0 + way * 0.01, 1.0 + w * 0.04 + way * 0.5 * PLAY], rtol=0.0, atol=1e-13)
    assert result.energy.stops == pytest.approx(0.5 * MOTOR * 4.0 - 0.5 * (MOTOR + OUTPUT) * w**2, rel=1e-12)


HEAVY = {"thermal.winding_capacity": 1e9, "thermal.housing_capacity": 1e9, "thermal.winding_to_housing": 1.0,
         "thermal.housing_to_ambient": 1.0}  # nothing warms up, but steps of an integrator are taken


@pytest.mark.parametrize("alike", [1e-3, 3e-3, 1e-2])  # s
@pytest.mark.parametrize("more", [{}, HEAVY], ids=["arcs", "steps"])
def test_flanks_that_would_leave_each_other_again_meet(more, alike):
    """A braked motor parts from a load that is braked evenly, then braked less: the way opens, closes, opens."""
    def run(duration, load):
        case = undriven(LOOSE | {"electronics.off_state": "brake"} | more)
        late = st.signals.pulse_train([duration + 1.0], [CENTRE], unit="s")
        return st.simulate(st.PulseServo(servo_of(case)), late, duration=duration, load=load, output_times=[duration],
                           initial={"output_speed": 8.0, "motor_angle": -0.5 * PLAY * N, "motor_speed": 8.0 * N})

    strong = 2.0 / 3.0  # N m
    parts = next(event.time for event in run(0.02, st.loads.Constant(strong)).events if event.kind == "gear parts")
    rate, start = strong / OUTPUT / run(parts, st.loads.Constant(strong))["output_speed"][0], parts + 5e-5
    then = run(start, st.loads.Constant(strong))
    q, w = then["output_angle"][0], then["output_speed"][0]
    q_m, w_m = then["motor_angle"][0] / N, then["motor_speed"][0] / N
    pull = rate * w_m * math.exp(-rate * alike)

    def way(t):
        return q_m - q + 0.5 * PLAY - w_m / rate * math.expm1(-rate * t) - w * t + 0.5 * pull * t * t

    end = start + 5.0 * alike
    found = run(end, st.loads.Recorded([0.0, start, start + 1e-12, end], [strong, strong, *[OUTPUT * pull] * 2]))
    assert way(5.0 * alike) > 0.0
    assert [event.kind for event in found.events][1:3] == ["gear parts", "gear meets"]
    assert found.events[2].time == pytest.approx(start + brentq(way, 1e-7, 2.0 * alike, xtol=1e-16), abs=1e-10)


# --- friction behind the play -----------------------------------------------------------------------------------------

SIDED = {"friction.coulomb_torque_forward": 0.24 / N, "friction.coulomb_torque_backward": 0.2 / N}


@pytest.mark.parametrize(("given", "bearing"), [({}, 0.06 * 0.2), ({"friction.bearing_coulomb_torque": 0.05}, 0.05),
                                                ({"friction.bearing_coulomb_torque": 0.0}, 0.0)])
def test_the_bearing_slows_the_output_and_the_rest_of_the_friction_the_motor(given, bearing):
    """Inside the play, open: ẇ = −T_o/J_L of the output and −(N F − T_o)/J_m of the motor; 0.06 of N F by default."""
    case = undriven(LOOSE | SIDED | given | {"electronics.off_state": "coast"}, duration=0.02,
                    initial={"output_angle": 0.0, "output_speed": 1.0, "motor_angle": 0.0, "motor_speed": 1.0 * N})
    result = simulate(case, np.array([0.002]))
    assert result["output_speed"][0] == pytest.approx(1.0 - bearing / OUTPUT * 0.002, rel=1e-12)
    assert result["motor_speed"][0] / N == pytest.approx(1.0 - (0.24 - bearing) / MOTOR * 0.002, rel=1e-12)
    assert result["load_torque"][0] == pytest.approx(-OUTPUT * bearing / OUTPUT, rel=1e-9, abs=1e-15)
    assert abs(result.energy.residual) < 1e-15


@pytest.mark.parametrize("way", [1, -1])
def test_the_bearing_holds_an_output_inside_the_play(way):
    """It holds up to T_o and no more; an output that it stops rests after w²J/(2 T_o)."""
    values = LOOSE | SIDED | {"friction.bearing_coulomb_torque": 0.05, "electronics.off_state": "coast"}
    held, starts = (simulate(undriven(values, load={"torque": -way * pull}, duration=0.02), np.array([0.02]))
                    for pull in (0.0499, 0.0501))
    assert held["output_speed"][0] == 0.0
    assert way * starts["output_speed"][0] == pytest.approx(0.0001 / OUTPUT * 0.02, rel=1e-9)
    initial = {"output_angle": 0.0, "output_speed": 0.5 * way, "motor_angle": 0.0, "motor_speed": 0.0}
    slides = simulate(undriven(values, duration=0.05, initial=initial), np.array([0.05]))
    assert slides["output_angle"][0] == pytest.approx(way * 0.5 * 0.5**2 * OUTPUT / 0.05, rel=1e-12)
    assert slides["output_speed"][0] == 0.0


def test_the_bearing_adds_nothing_while_the_teeth_touch():
    """A driven move whose teeth never part; it starts a rounding beside the flank."""
    load = {"torque": 0.1, "coulomb_torque": 0.02}
    runs = [simulate(driven(LOOSE | SIDED | {"friction.bearing_coulomb_torque": T_o}, load=load, duration=0.05,
                            initial={"output_angle": -0.2, "motor_angle": N * (-0.2 + 0.5 * PLAY)}), np.array([0.05]))
            for T_o in (0.0, 0.1)]
    assert runs[0]["output_angle"][0] == pytest.approx(runs[1]["output_angle"][0], abs=2e-9)
    assert abs(runs[0]["output_angle"][0] + 0.2) > 0.01


# --- dead time --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", [1, -1])
def test_dead_time_of_a_full_drive_across_the_play(way):
    """The motor alone: x = w_0 (t − T (1 − e^(−t/T))), T = J_m R/K², from the far flank to the near one."""
    case = driven(LOOSE, way=way, load={"coulomb_torque": 0.05}, duration=0.05)
    case.initial["motor_angle"] = N * (case.initial["output_angle"] - way * 0.5 * PLAY)
    result = simulate(case, np.array([0.05]))
    start, meets = (next(e.time for e in result.events if e.kind.startswith(kind)) for kind in ("drive", "gear meets"))
    w_0, T = 6.0, MOTOR * 3.0
    dead = brentq(lambda t: w_0 * (t + T * math.expm1(-t / T)) - PLAY, 1e-4, 0.1, xtol=1e-15)
    assert meets - start == pytest.approx(dead, rel=1e-11)
    assert result.at("output_speed", [meets - 1e-9])[0] == 0.0


@pytest.mark.long
def test_each_reversal_of_a_sine_costs_the_play():
    """The load's own friction stops the output; the motor crosses alone, as long as the play takes at its speed."""
    dry = {"friction.coulomb_torque_forward": 0.05 / N, "friction.coulomb_torque_backward": 0.05 / N}
    values = SIMPLE | LOOSE | dry | {"electronics.stretcher_gain": 60.0, "electronics.frame_period": 5e-3}
    frequency, duration = 1.0, 2.0
    command = Command(kind="sine", before=CENTRE, amplitude=0.3 * 1.3e-3 * 0.44, frequency=frequency)
    case = replace(undriven(values, command=command, load={"coulomb_torque": 0.1}, duration=duration), edges=None)
    result = simulate(case, np.array([duration]))
    dead = []
    for parts, meets in alone(result):
        times = np.linspace(parts, meets, 2001)[:-1]
        gap = result.at("motor_angle", times) / N - result.at("output_angle", times)
        if gap[0] * gap[-1] >= 0.0:
            continue  # the start in the middle, or back to the flank that it had left
        assert abs(gap[-1] - gap[0]) == pytest.approx(PLAY, rel=2e-3)
        moving = result.at("output_speed", times) != 0.0
        assert np.mean(moving) < 0.1  # the output has stopped, or does so at once
        speed = result.at("motor_speed", times) / N
        assert meets - parts == pytest.approx(PLAY / abs(np.mean(speed)), rel=0.02)
        dead.append((parts, meets, np.sign(gap[-1])))
    # The first swing starts in the middle of the play; then both ends of each swing cost it, to and fro.
    assert len(dead) == 2.0 * frequency * duration
    assert np.all(np.diff([way for _, _, way in dead]) != 0.0)
    turns = np.array([0.25, 0.75, 1.25, 1.75]) / frequency
    assert np.all(np.array([parts for parts, _, _ in dead]) > turns)
    assert np.all(np.array([meets for _, meets, _ in dead]) < turns + 0.25 / frequency)


def alone(result):
    """When motor and output were apart, from their parting to their meeting [s]."""
    runs = groupby(result.trajectory.segments, lambda segment: segment.motion.mode.mesh == INSIDE)
    spans = [(list(run), inside) for inside, run in runs]
    return [(run[0].start, run[-1].end) for run, inside in spans if inside]


# --- parting ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_flanks_push_and_never_pull(seed):
    """All inertia behind the play is the load's, so that the contact's force is the torque given to the load."""
    case = random_case(seed, frozenset({"backlash", "coulomb"})).replace(gear__output_inertia=None)
    case.load["inertia"] = case.load.get("inertia", 0.0) + 2e-3
    bearing = make_plant(case.values, case.load).bearing
    times = np.linspace(0.0, case.duration, 4001)
    result = simulate(case, times)
    force, samples = result["load_torque"], result.trajectory.at(times)
    gap = samples.motor_angle - samples.angle
    half = 0.5 * case.values["gear.backlash"]
    inside = samples.mesh == INSIDE
    assert 0.01 < np.mean(inside) < 0.999
    assert np.all(np.abs(gap) <= half + 1e-14)
    turns = inside & (samples.speed != 0.0)  # the output's bearing brakes what turns with it
    np.testing.assert_allclose(force[turns], -bearing * np.sign(samples.speed[turns]), rtol=0.0, atol=1e-12)
    moving = ~inside & (samples.speed != 0.0)  # at rest statics does not tell who holds
    assert np.max(np.abs(force[moving])) > 0.05
    assert np.all(force[moving] * np.sign(gap[moving]) > -1e-12)
    np.testing.assert_allclose(np.abs(gap[~inside]), half, rtol=1e-12)


@pytest.mark.parametrize("pull", [0.05, 0.2])
def test_they_part_where_the_force_changes_its_sign(pull):
    """Both are slowed by constant torques, the motor by its friction F, the output by the load's pull τ.

    Open, with the motor on the flank that pushes forward: they part at once if F/J_m > τ/J_L, and else never.
    """
    F = 0.24
    case = undriven(LOOSE | {"electronics.off_state": "coast", "friction.coulomb_torque_forward": F / N},
                    load={"torque": pull}, duration=0.02,
                    initial={"output_angle": 0.0, "output_speed": 2.0, "motor_angle": 0.5 * PLAY * N,
                             "motor_speed": 2.0 * N})
    result = simulate(case, np.array([0.01]))
    w_m, w = result["motor_speed"][0] / N, result["output_speed"][0]
    parts = F / MOTOR > pull / OUTPUT
    assert w_m == pytest.approx(2.0 - (F / MOTOR if parts else (F + pull) / (MOTOR + OUTPUT)) * 0.01, rel=1e-12)
    assert w == pytest.approx(2.0 - (pull / OUTPUT if parts else (F + pull) / (MOTOR + OUTPUT)) * 0.01, rel=1e-12)


def test_a_spring_lets_go_in_its_middle():
    """A spring on the output pushes the motor before it; from where it would pull, the motor flies on alone."""
    stiffness, swing = 0.8, 0.1
    case = undriven(LOOSE | {"electronics.off_state": "coast"}, duration=0.3,
                    load={"spring.stiffness": stiffness, "spring.rest_angle": 0.0},
                    initial={"output_angle": -swing, "motor_angle": N * (-swing - 0.5 * PLAY)})
    result = simulate(case, np.array([0.17]))
    rate = math.sqrt(stiffness / (MOTOR + OUTPUT))
    parts = [event.time for event in result.events if event.kind == "gear parts"]
    assert parts[0] == pytest.approx(0.5 * math.pi / rate, rel=1e-11)
    assert result["motor_speed"][0] / N == pytest.approx(swing * rate, rel=1e-11)
    age, alone_rate = 0.17 - parts[0], math.sqrt(stiffness / OUTPUT)
    assert result["output_angle"][0] == pytest.approx(swing * rate / alone_rate * math.sin(alone_rate * age), rel=1e-9)


# --- energy -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_energy_closes_across_the_play(seed):
    case = random_case(seed, frozenset({"backlash", "coulomb", "stops"}))
    energy = simulate(case, np.array([case.duration])).energy
    turnover = abs(energy.supply) + energy.winding + abs(energy.load) + energy.friction
    assert abs(energy.residual) <= 1e-9 * turnover
    assert energy.stops > 0.0

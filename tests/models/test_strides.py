"""Strides: against fine solutions and closed forms, in batches against one servo alone, and cut in time."""

import math
import pickle
from functools import cache
from itertools import cycle

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import servotwin as st
from lane_cases import replaced
from servotwin.models.engine.batch import rk_batch, rk_steps, tiles
from servotwin.models.engine.batch.rk_steps import Aim, State
from servotwin.models.engine.memory import FIRST_STEP
from servotwin.models.state.records import fill, room
from servotwin.models.terms.bridge import NO_BRIDGE, Off
from servotwin.models.terms.friction import NO_FRICTION
from servotwin.models.terms.heat import Heat
from servotwin.models.terms.load import NO_LOAD
from servotwin.models.terms.motor import Motor
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.shaft import Shaft
from servotwin.models.terms.source import Source
from servotwin.simulation.lanes import forms

REFERENCE = 298.15  # K, at which resistance and magnets are given
PLAIN = Numbers(
    motor=Motor(1.03, 1.0, 3.0, 0.0), shaft=Shaft(6e-3, 2e-3, 1e-3, 1e-3), source=Source(6.0, 0.05, math.inf),
    bridge=NO_BRIDGE._replace(D_drive=0.4, R_drive=3.15, off=Off(0.0, 3.0, 0.0)),
    friction=NO_FRICTION._replace(F_forward=0.2, F_backward=0.25))
HOT = replaced(PLAIN, {"heat": Heat(0.02, 0.3, 0.1, 0.05, 295.0, -1.5e-3)})
SWINGING = replaced(HOT, {"load": NO_LOAD._replace(gravity=0.5, hanging_angle=-0.4, stiffness=0.3, rest_angle=0.1)})
FADING = replaced(SWINGING, {
    "friction.varies": 1.0, "friction.w_s": 0.05, "friction.alpha": 1.5, "friction.breakaway": 1.4})
OPEN = replaced(SWINGING, {"bridge.off": Off(6.7, 3.2, 1.0)})
AT = State(0.3, 0.0, 310.0, 300.0)


def law(numbers, u, tau, way):
    """Return what gives the rates of angle, speed and both temperatures; `way` 0: the shaft is held."""
    motor, path, own, dry, hangs, heat = (getattr(numbers, name) for name in (
        "motor", "bridge", "shaft", "friction", "load", "heat"))
    D, R = (path.D_drive, path.R_drive) if u else path.off[:2]
    F = dry.F_forward if way > 0.0 else dry.F_backward

    def rates(_, y):
        q, w, T_w, T_h = y
        R_w = motor.R * (1.0 + 0.00385 * (T_w - REFERENCE)) if heat.C_w else motor.R
        field = 1.0 + heat.magnet * (T_h - REFERENCE)
        x = u - motor.K_b * field * w
        i = (x - math.copysign(D, x)) / (R - motor.R + R_w) if abs(x) > D else 0.0
        static = math.exp(-((abs(w) / dry.w_s) ** dry.alpha)) if dry.varies else 0.0
        against = tau + hangs.gravity * math.sin(q - hangs.hanging_angle) + hangs.stiffness * (q - hangs.rest_angle)
        dw = (motor.K * field * i - own.b * w - way * F * (1.0 + (dry.breakaway - 1.0) * static) - against) / own.J
        flow = heat.G_wh * (T_w - T_h)
        return [w, dw if way else 0.0, (i * i * R_w - flow) / (heat.C_w or math.inf),
                (flow - heat.G_ha * (T_h - heat.T_amb)) / (heat.C_h or math.inf)]

    return rates


def fine(numbers, u, tau, way, state, time):
    run = solve_ivp(law(numbers, u, tau, way), (0.0, time), state, method="DOP853", rtol=1e-13, atol=1e-15)
    return run.y[:, -1]


def take(numbers, u, tau, state, aims):
    """Let a shaft take a stride to each of up to eight aims; return for each where it has led, and its time."""
    room_ = tiles.plan_room("float64", tiles.STRIDES)[0].of.slots
    mode, stride, after = rk_steps.entered(numbers, u, tau, state), room_.stride, room_.after
    for k, aim in zip(range(rk_steps.SLOTS), cycle(aims), strict=False):
        rk_steps.put_numbers_in(room_.own, k, numbers)
        rk_steps.put_before_in(room_.before, k, state)
        stride.u[k], stride.tau[k], stride.tolerance[k], stride.left[k] = u, tau, 1.0, 1.0
        stride.reach[k], stride.origin[k], stride.rise[k] = aim
        stride.curved[k], room_.busy.tries[k] = numbers.friction.varies, 1
        room_.busy.zone[k], room_.busy.contact[k], room_.busy.share[k] = mode.zone, mode.contact, mode.share
    rk_steps.step(room_)
    return [(State(after.q[k], after.w[k], after.T_w[k], after.T_h[k]), after.t[k]) for k in range(len(aims))]


# What moves, the voltage behind its bridge, its torque, its speed, whether it goes by speed and its root, and how far
STRIDES = {
    "heat": (HOT, 6.0, 0.1, 2.0, "time", 12e-3), "heat, back": (HOT, -6.0, 0.1, -2.0, "time", 12e-3),
    "braked": (SWINGING, 0.0, 0.1, 3.0, "time", 12e-3), "braked, back": (SWINGING, 0.0, 0.1, -3.0, "time", 12e-3),
    "open, back": (OPEN, 0.0, 0.1, -3.0, "time", 12e-3), "from rest": (SWINGING, 6.0, 0.1, 0.0, "time", 12e-3),
    "to rest": (SWINGING, 0.0, 0.2, 1.5, "speed", -1.5), "to rest, back": (SWINGING, 0.0, -0.9, -1.5, "speed", 1.5),
    "to rest, against the drive": (HOT, -6.0, 0.0, 3.0, "speed", -3.0),
    "fading": (FADING, 0.0, 0.2, 0.02, "root", -0.02), "fading, back": (FADING, 0.0, -0.9, -0.02, "root", 0.02),
    "out of rest": (FADING, 6.0, 0.2, 0.0, "root", 0.02), "out of rest, back": (FADING, -6.0, 0.2, 0.0, "root", -0.02),
}


def errors_of(name, parts):
    """Return the errors of strides that go through such parts of the one of that name."""
    numbers, u, tau, w, by, far = STRIDES[name]
    state, way = AT._replace(w=w), math.copysign(1.0, w or far)
    power = 2 if by == "root" else 1
    origin, end = (abs(x) ** (1 / power) for x in (w, w + far))
    aims = [Aim(part * far, 0.0, 0.0) if by == "time" else Aim(1.0, origin, part * (end - origin)) for part in parts]
    found = take(numbers, u, tau, state, aims)
    for (to, time), aim in zip(found, aims, strict=True):
        if by == "time":
            assert time == pytest.approx(aim.reach, rel=1e-14)
        else:
            assert to.w == way * (aim.origin + aim.rise) ** power
            assert time > 0.0
    return np.array([np.abs(np.subtract(to, fine(numbers, u, tau, way, state, time))).max() for to, time in found])


@pytest.mark.parametrize("name", STRIDES)
def test_a_stride_follows_the_law(name):
    assert errors_of(name, [0.02, 0.1, 0.15]).max() < 2e-12


@pytest.mark.parametrize("name", [name for name in STRIDES if name != "open, back"])  # there it is exact
def test_half_a_stride_has_an_error_of_order_nine(name):
    """From rest by the root one of order ten, for there the rates begin with the root itself."""
    whole, half = errors_of(name, [1.0, 0.5])
    assert 1e-9 < whole < 2e-7
    assert 8.0 < math.log2(whole / half) < (11.0 if STRIDES[name][4] != "time" else 9.2)


def go(numbers, power, torque, start, times, accuracy=1e-11):
    """Let copies of a shaft go through a phase of such times each; return angles, speeds and temperatures."""
    rows, plan = room(1, tiles.tile_type("float64", tiles.STRIDES)), tiles.plan_room("float64", tiles.STRIDES)[0].of
    count, tile = len(times), rows[0]
    fill(rows["own"], numbers)
    tile.hung.torque[:count] = torque
    tile.hung.tolerance[:count] = accuracy * (rk_steps.STEEP if numbers.friction.varies else rk_steps.SMOOTH)
    tile.servo.step[:count] = FIRST_STEP
    for name, value in zip(State._fields, start, strict=True):
        tile.servo[name][:count] = value
    plan.power[:count], plan.time[:count] = power, times
    with np.errstate(invalid="ignore"):  # in slots that stay empty
        rk_batch.phase(count, False, tile, plan)
    assert not plan.lost[:count].any()
    return np.array([tile.servo[name][:count].copy() for name in State._fields])


@pytest.mark.long(but="off4-0.15-1e-07")
@pytest.mark.parametrize(("off", "torque", "w"), [
    (Off(0.0, 3.0, 0.0), 0.0, 4.0), (Off(0.0, 3.0, 0.0), -0.1, -0.02), (Off(6.7, 3.2, 1.0), 0.1, 1e-4),
    (Off(6.7, 3.2, 1.0), -0.2, -5.0), (Off(0.0, 3.0, 0.0), 0.15, 1e-7)])
def test_a_shaft_stands_still_exactly_and_at_its_time(off, torque, w):
    """Under Coulomb and viscous friction, braked or open: J dw/dt = -a - c w until it rests."""
    numbers, way = replaced(PLAIN, {"bridge.off": off}), math.copysign(1.0, w)
    own, motor, dry = numbers.shaft, numbers.motor, numbers.friction
    c = own.b + (motor.K * motor.K_b / off.R if off.D == 0.0 else 0.0)
    a = (dry.F_forward if w > 0.0 else dry.F_backward) + way * torque
    rests = own.J / c * math.log1p(c * abs(w) / a)
    angle = way * (own.J * abs(w) - a * rests) / c
    (q, q_then, q_last), (w_before, w_then, w_last), _, _ = go(
        numbers, 0.0, torque, AT._replace(w=w), np.array([1.0 - 1e-6, 1.0 + 1e-9, 5.0]) * rests)
    assert w_then == w_last == 0.0
    assert [q, q_then, q_last] == pytest.approx([AT.q + angle] * 3, abs=2e-12)
    assert w_before == pytest.approx(way * a / own.J * 1e-6 * rests, rel=1e-3, abs=1e-12)


def test_a_shaft_at_rest_cools_as_two_masses_do():
    """As the matrix exponential has it; and in two parts as in one."""
    heat, times = HOT.heat, np.array([1e-6, 0.02, 0.3, 7.0, 500.0])
    A = np.array([[-heat.G_wh / heat.C_w, heat.G_wh / heat.C_w],
                  [heat.G_wh / heat.C_h, -(heat.G_wh + heat.G_ha) / heat.C_h]])
    start = np.array([400.0, 320.0])
    q, w, *warmth = go(SWINGING, 0.0, 0.0, State(-0.3, 0.0, *start), times)
    assert (q == -0.3).all()
    assert (w == 0.0).all()
    exact = [heat.T_amb + expm(A * time) @ (start - heat.T_amb) for time in times]
    np.testing.assert_allclose(np.transpose(warmth), exact, rtol=1e-13)
    half = go(SWINGING, 0.0, 0.0, State(-0.3, 0.0, *start), 0.3 * times)
    np.testing.assert_allclose(go(SWINGING, 0.0, 0.0, half, 0.7 * times)[2:], warmth, rtol=1e-14)


@pytest.mark.long
@pytest.mark.parametrize(("numbers", "power", "torque", "w"), [
    (SWINGING, 1.0, 0.1, 0.0), (FADING, -1.0, 0.1, 2.0), (FADING, 0.0, 1.5, 0.0), (HOT, 1.0, 1.8, 0.0),
    (OPEN, 0.0, 0.4, 5.0)], ids=["driven", "turned back", "falling", "stalled and heated", "open"])
def test_a_phase_in_two_parts_is_the_phase(numbers, power, torque, w):
    times, accuracy = np.array([1e-4, 0.008]), 1e-7
    whole = go(numbers, power, torque, AT._replace(w=w), times, accuracy)
    part = go(numbers, power, torque, AT._replace(w=w), 0.37 * times, accuracy)
    np.testing.assert_allclose(go(numbers, power, torque, part, 0.63 * times, accuracy), whole, rtol=0.0, atol=accuracy)
    assert np.abs(np.diff(whole)).max() > 1e-3


def test_a_shaft_that_is_held_is_heated():
    q, w, *warmth = go(HOT, 1.0, 1.8, AT, np.array([1e-3, 0.02]))
    assert (q == AT.q).all()
    assert (w == 0.0).all()
    for k, time in enumerate((1e-3, 0.02)):
        assert [T[k] for T in warmth] == pytest.approx(fine(HOT, 6.0, 1.8, 0.0, AT, time)[2:], rel=1e-13)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_current_that_ends_before_a_standstill(way):
    """The drop of brushes ends it while a load brings the shaft to rest, and then moves it back."""
    numbers, start = replaced(HOT, {"bridge.off.D": 0.3, "shaft.J": 0.03}), AT._replace(w=0.78 * way)

    def rests(_, y):
        return way * y[1]

    rests.terminal = True
    run = solve_ivp(law(numbers, 0.0, 1.1 * way, way), (0.0, 0.1), start, method="DOP853", rtol=1e-12, atol=1e-14,
                    max_step=1e-4, events=rests)
    back = fine(numbers, 0.0, 1.1 * way, -way, (run.y[0, -1], 0.0, *run.y[2:, -1]), 2e-3)
    found = go(numbers, 0.0, 1.1 * way, start, [run.t[-1] + 2e-3], 1e-8)
    assert found[:, 0] == pytest.approx(back, abs=1e-8)


@pytest.mark.slow
def test_a_current_that_flows_for_less_than_a_stride():
    """A spring drives the shaft a little beyond the drop of brushes, and slows it down again."""
    numbers = replaced(HOT, {"bridge.off.D": 2.0885, "load.stiffness": 6.0})  # V; its most is 1e-3 higher
    start = State(-0.1, 0.0, REFERENCE, REFERENCE)
    exact = solve_ivp(law(numbers, 0.0, 0.0, 1.0), (0.0, 0.06), start, method="DOP853", rtol=1e-12, atol=1e-14,
                      max_step=2e-4).y[0, -1]
    assert go(numbers, 0.0, 0.0, start, [0.06], 1e-7)[0] == pytest.approx(exact, abs=1e-8)


# --- many servos ------------------------------------------------------------------------------------------------------

SERVO = st.load_servo("hitec-hs-755hb").replace({
    "gear.output_inertia": 1e-3, "friction.breakaway_ratio": 1.3, "supply.internal_resistance": 0.2,
    "potentiometer.noise": 1e-3})
HEAT = {"thermal.winding_capacity": 0.5, "thermal.housing_capacity": 5.0, "thermal.winding_to_housing": 8.0,
        "thermal.housing_to_ambient": 10.0, "thermal.magnet_coefficient": -1.5e-3}
STRIBECK = {"friction.stribeck_speed": 10.0, "friction.stribeck_exponent": 1.5}
PUSHED = {"friction.load_friction_motor": 0.08, "friction.load_friction_external": 0.1}
FLEETS = {  # what is changed, and what hangs on it
    "heat": (HEAT, None), "pendulum": ({}, "pendulum"), "spring": ({}, "spring"),
    "heat, pendulum": (HEAT, "pendulum"),
    "open, pendulum": ({"electronics.off_state": "coast"}, "pendulum"),
    "play of the potentiometer, pendulum": ({"potentiometer.backlash": 0.01}, "pendulum"),
    "M3, pendulum": ({"friction.load_friction": 0.08}, "pendulum"), "M5, pendulum": (PUSHED, "pendulum"),
    "Stribeck, pendulum": (STRIBECK, "pendulum"),
    "M6, pendulum": (STRIBECK | PUSHED | {
        "friction.load_friction_motor_stribeck": 0.04, "friction.load_friction_external_stribeck": 0.05,
        "friction.load_friction_motor_quad": 0.1, "friction.load_friction_external_quad": 0.2}, "pendulum"),
    "regulator, heat": (HEAT | {"supply.current_limit": 1.2}, None)}
COUNT, DURATION = 32, 0.3
TIMES = np.sort(np.random.default_rng(1).uniform(0.0, DURATION, 25))
SIGNALS = ("output_angle", "output_speed", "drive")
WARM = ("winding_temperature", "housing_temperature", "armature_current")


@cache
def fleet(name):
    """Return model, commands, loads, parameters and seeds of random servos."""
    changes, hangs = FLEETS[name]
    rng = np.random.default_rng(5)
    model = st.PulseServo(SERVO.replace(changes))
    spread = {of: model.servo.source(of).value * rng.uniform(0.8, 1.2, COUNT) for of in (
        "motor.armature_resistance", "friction.coulomb_torque_forward", "friction.coulomb_torque_backward",
        "electronics.stretcher_gain", *(changes and [of for of in changes if of.startswith("thermal.w")]))}
    loads = []
    for _ in range(COUNT):
        more = {None: st.loads.Coulomb(rng.uniform(0.0, 0.02)),
                "pendulum": st.loads.Pendulum(rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.15),
                                              hanging_angle=rng.uniform(-2.0, 2.0)),
                "spring": st.loads.Spring(rng.uniform(0.05, 0.4), rng.uniform(0.5, 1.5))}[hangs]
        loads.append(st.loads.Constant(rng.uniform(-0.2, 0.2)) + st.loads.Inertia(rng.uniform(0.0, 3e-3)) + more)
    commands = [st.signals.samples([0.0, *np.sort(rng.uniform(0.0, DURATION, 3))], rng.uniform(0.9e-3, 2.1e-3, 4),
                                   unit="s") for _ in range(COUNT)]
    return model, commands, loads, spread, rng.integers(0, 1000, COUNT)


def signals_of(name):
    return (*SIGNALS, *WARM) if HEAT.items() <= FLEETS[name][0].items() else SIGNALS


def many(name, which, **options):
    """Run some servos of a fleet as a batch."""
    model, commands, loads, spread, seeds = fleet(name)
    return st.simulate_many(model, [commands[k] for k in which], duration=DURATION, load=[loads[k] for k in which],
                            parameters={of: x[which] for of, x in spread.items()}, seeds=seeds[which],
                            output_times=TIMES, outputs=signals_of(name), **options)


@cache
def alone(name):
    """Return the signals of each servo of a fleet on its own, as exactly as it goes."""
    model, commands, loads, spread, seeds = fleet(name)
    runs = [st.simulate(st.PulseServo(model.servo.replace({of: x[k].item() for of, x in spread.items()})), commands[k],
                        duration=DURATION, load=loads[k], output_times=TIMES, seed=int(seeds[k]), accuracy=1e-11)
            for k in range(COUNT)]
    return {signal: np.array([run[signal] for run in runs]) for signal in signals_of(name)}


@pytest.mark.parametrize("name", FLEETS)
def test_fleets_go_by_strides(name):
    model, _, loads, _, _ = fleet(name)
    numbers, nobody = model.pack(loads[0]), np.zeros(3, np.bool_)
    (kind,) = forms.kinds_with(numbers, model.chip(), 3, "float32", nobody, nobody, False)
    assert (kind.form, kind.dtype) == (tiles.STRIDES, "float64")


@pytest.mark.long(but="spring-1e-09")
@pytest.mark.parametrize("accuracy", [1e-7, 1e-9])
@pytest.mark.parametrize("name", FLEETS)
def test_a_fleet_is_as_accurate_as_asked(name, accuracy):
    batch, exact = many(name, np.arange(COUNT), accuracy=accuracy), alone(name)
    assert batch.ok
    assert np.ptp(exact["output_angle"], axis=1).min() > 0.01
    assert np.abs(batch["output_angle"] - exact["output_angle"]).max() < accuracy
    np.testing.assert_array_equal(batch["drive"], exact["drive"])
    np.testing.assert_array_equal(np.sign(batch["output_speed"]), np.sign(exact["output_speed"]))


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in FLEETS if len(signals_of(name)) > 3])
def test_signals_of_a_warm_fleet(name):
    batch, exact = many(name, np.arange(COUNT), accuracy=1e-11), alone(name)
    assert np.ptp(exact["winding_temperature"]) > 1.0
    for signal in WARM:
        np.testing.assert_allclose(batch[signal], exact[signal], rtol=1e-9, atol=1e-9, err_msg=signal)


@pytest.mark.long(but="heat, pendulum")
@pytest.mark.parametrize("name", ["heat, pendulum", "play of the potentiometer, pendulum", "M6, pendulum"])
def test_lanes_know_nothing_of_each_other(name):
    """However many there are for the slots, in whatever chunks and order."""
    whole = many(name, np.arange(COUNT))
    rng = np.random.default_rng(2)
    ways = [(np.arange(COUNT), chunk) for chunk in (1, 3, 7, 8, 9, 31)]
    ways += [(rng.permutation(COUNT)[:count], None) for count in (1, 2, 3, 8, 13, 32)]
    for which, chunk in ways:
        part = many(name, which, chunk=chunk)
        for signal in signals_of(name):
            np.testing.assert_array_equal(part[signal], whole[signal][which])


# --- that stop and go on ----------------------------------------------------------------------------------------------

LANES = 11
WARM_SERVO, HUNG = st.PulseServo(SERVO.replace(HEAT)), st.loads.Pendulum(0.15, 0.1, hanging_angle=0.4)
ENSEMBLES = {"heat": (WARM_SERVO, st.loads.Inertia(1e-3), "load.torque"),
             "pendulum": (st.PulseServo(SERVO), HUNG, "load.pendulum.mass"),
             "heat, pendulum": (WARM_SERVO, HUNG, "load.pendulum.mass")}


def ensemble(name):
    """Return servos with different loads, the loads by name, and ticks [s] with pulse widths."""
    model, load, of = ENSEMBLES[name]
    rng = np.random.default_rng(9)
    own = {of: rng.uniform(0.05, 0.25, LANES)}
    sims = st.VectorSimulator(model, LANES, load=load, parameters=own, seed=3)
    sims.reset(pulse_width=1500e-6)
    ticks = np.diff(np.sort(rng.uniform(0.0, 0.3, 40)), prepend=0.0)
    return sims, own, list(zip(ticks, np.repeat(rng.uniform(1.0e-3, 2.0e-3, (4, LANES)), 10, axis=0), strict=True))


@pytest.mark.long(but="pendulum")
@pytest.mark.parametrize("name", ENSEMBLES)
def test_many_that_go_on_are_simulators(name):
    """Cut at random instants, and read there."""
    model, load, _ = ENSEMBLES[name]
    sims, own, ticks = ensemble(name)
    alone = [st.Simulator(model, load, 3 + lane) for lane in range(LANES)]
    states = [sim.changed(sim.initial(st.signals.constant(1500.0, unit="us")), parameters={
        of: x[lane].item() for of, x in own.items()}) for lane, sim in enumerate(alone)]
    start, moved = sims["output_angle"], np.zeros(LANES)
    for k, (duration, widths) in enumerate(ticks):
        sims.advance(duration, pulse_width=widths)
        commands = [st.signals.constant(1e6 * width, unit="us") for width in widths]
        states = [sim.advance(state, time, command) for sim, state, time, command in zip(
            alone, states, sims.time, commands, strict=True)]
        np.testing.assert_allclose(sims["output_angle"], [state["output_angle"] for state in states], rtol=0, atol=1e-9)
        moved = np.maximum(moved, np.abs(sims["output_angle"] - start))
        if k % 8 == 0:
            for signal in set(model.available) & {"drive", *WARM}:
                expected = [sim.observe(*args) for sim, *args in zip(
                    alone, states, [signal] * LANES, commands, strict=True)]
                np.testing.assert_allclose(sims[signal], expected, rtol=1e-9, atol=1e-9, err_msg=signal)
    assert moved.min() > 0.03


@pytest.mark.parametrize("name", ENSEMBLES)
def test_what_was_saved_goes_on_bit_for_bit(name):
    sims, _, ticks = ensemble(name)
    for duration, widths in ticks[:17]:
        sims.advance(duration, pulse_width=widths)
    memory = pickle.loads(pickle.dumps(sims.save()))
    runs = []
    for some in (sims, ensemble(name)[0], sims):
        some.restore(memory)
        seen = []
        for duration, widths in ticks[17:]:
            some.advance(duration, pulse_width=widths)
            seen += [some[signal] for signal in ("output_angle", "output_speed", "armature_current", "error_time")]
        runs.append(seen)
    np.testing.assert_array_equal(runs[0], runs[1])
    np.testing.assert_array_equal(runs[0], runs[2])


@pytest.mark.parametrize("off_state", ["brake", "coast"])
def test_a_pendulum_that_is_set_high_falls(off_state):
    """As one that has begun there, and never higher than that."""
    model = st.PulseServo(SERVO.replace({"electronics.deadband": 5e-3, "electronics.off_state": off_state,
                                         "potentiometer.noise": 0.0}))
    load = st.loads.Pendulum(0.6, 0.15, hanging_angle=1.5)
    sims, sim = st.VectorSimulator(model, LANES, load=load), st.Simulator(model, load)
    command = st.signals.constant(1500.0, unit="us")
    sims.reset(pulse_width=1500e-6)
    sims.advance(0.033)
    angles = np.linspace(-0.1, 3.1, LANES)
    sims.set(output_angle=angles)
    np.testing.assert_array_equal(sims["output_angle"], angles)
    states = [sim.initial(command, {"output_angle": angle}) for angle in angles]
    fell = np.zeros(LANES)
    for _ in range(40):
        sims.advance(5e-3)
        states = [sim.advance(state, state.time + 5e-3, command) for state in states]
        fell = np.maximum(fell, np.abs(sims["output_angle"] - angles))
        np.testing.assert_allclose(sims["output_angle"], [state["output_angle"] for state in states], rtol=0, atol=1e-9)
        assert (np.abs(sims["output_angle"] - 1.5) <= np.abs(angles - 1.5) + 1e-12).all()
    assert (sims["drive"] == 0.0).all()
    assert fell[[0, -1]].min() > 0.1
    assert fell.min() == 0.0

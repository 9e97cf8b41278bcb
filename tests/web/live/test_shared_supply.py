"""Servos of a bench on one supply do what `simulate_bus` and `VectorSimulator` say of them, however time is cut."""

import math
import random

import numpy as np
import pytest

import servotwin as st
from falling_supplies import BIG, SITUATIONS, STS, XL
from servotwin.errors import InputError
from servotwin.simulation import bus_run
from servotwin.simulation.compile import kernels
from servotwin.web.live import LiveBench, read_scene

SUPPLY = {"open_circuit_voltage": 6.0, "internal_resistance": 0.5}
ANALOG, DIGITAL = "hitec-hs-755hb", "towerpro-mg996r"
COAST = '"electronics.off_state" = "coast"'
CASES = [([(ANALOG, "PulseServo", "")] * 2, {}), ([(ANALOG, "PulseServo", "")] * 2, {"current_limit": 1.0}),
         ([(ANALOG, "PulseServo", COAST), (ANALOG, "PulseServoInductive", COAST),
           (ANALOG, "PulseServo", '"electronics.supply_coupling" = 0.01')], {}),
         ([(DIGITAL, "DigitalServo", "")] * 2, {}), ([(ANALOG, "PulseServo", ""), (DIGITAL, "DigitalServo", "")], {})]


def scene_text(servos, supply, more: str = "") -> str:
    lines = ["format = 1", "seed = 5", more]
    for name, model, parameters in servos:
        lines += ["[[servo]]", f'id = "{name}"', f'model = "{model}"', f"parameters = {{{parameters}}}"]
    volts = (f"{key} = {value}" for key, value in supply.items())
    return "\n".join([*lines, "[load]", "inertia = 2e-4", "[supply]", *volts])


def gone_on(bench: LiveBench, end: float, pace: random.Random) -> tuple[list, list]:
    """Let a bench go on in pieces; return the pulses of each servo, and its rows."""
    pulses, rows = ([[] for _ in bench.models] for _ in range(2))
    while bench.time < end:
        push = bench.advance(min(end, bench.time + pace.choice([1e-5, 7e-4, 1 / 60, 0.02, 0.13])), 100.0)
        for k, seen in enumerate(push.servos):
            pulses[k] += seen.pulses
            rows[k] += seen.points
    return pulses, rows


def angles(bench: LiveBench) -> list[float]:
    return [row[names.index("output_angle")] for row, names in zip(bench.rows, bench.columns, strict=True)]


@pytest.mark.long(but="servos0-more0")
@pytest.mark.parametrize(("servos", "more"), CASES)
def test_they_do_what_a_fleet_does(servos, more):
    supply = SUPPLY | more
    bench = LiveBench(read_scene(scene_text(servos, supply)))
    bench.do("command", {"shape": "hold", "unit": "us", "value": 1400.0})
    bench.do("command", {"shape": "step", "unit": "us", "low": 1400.0, "high": 1800.0, "period": 0.5})
    pulses, rows = gone_on(bench, 1.0, random.Random(3))
    fleet = st.simulate_bus(
        {str(k): (getattr(st, model)(st.load_servo(name).replace(dict(_read(parameters)))),
                  st.signals.pulse_train(*zip(*pulses[k], strict=True), unit="s"), _load())
         for k, (name, model, parameters) in enumerate(servos)},
        supply=st.Supply(**supply), duration=1.0, seed=5,
        initial={str(k): {"output_angle": first} for k, first in enumerate(angles(LiveBench(bench.scene())))})
    expected = [fleet[name]["output_angle"][-1] for name in fleet]
    np.testing.assert_allclose(angles(bench), expected, atol=1e-9)
    assert fleet.bus_voltage.min() < 5.5
    time, volts = np.array(rows[0])[:, [0, bench.columns[0].index("bus_voltage")]].T
    if not more:  # Kirchhoff: what the supply loses is what all draw
        drawn = sum(np.array(own)[:, names.index("supply_current")]
                    for own, names in zip(rows, bench.columns, strict=True))
        np.testing.assert_allclose(volts, 6.0 - 0.5 * drawn, atol=1e-9)
    sides = [fleet.bus(np.clip(time + shift, 0.0, 1.0)) for shift in (-1e-11, 1e-11)]  # of a switch
    np.testing.assert_allclose(np.min(np.abs(volts - sides), axis=0), 0.0, atol=1e-6)


def _load():
    return st.loads.Inertia(2e-4) + st.loads.Pendulum(mass=0.0, length=0.1)


def _read(parameters: str) -> dict:
    import tomllib

    return tomllib.loads(f"x = {{{parameters}}}")["x"]


def test_numbers_pushes_and_the_supply_change_as_time_goes_on():
    changes = [(0.2, "push", 0.2), (0.3, "set", {"load.inertia": 4e-4}), (0.4, "set", {"electronics.deadband": 2e-5}),
               (0.5, "push", -0.1), (0.62, "set", {"friction.coulomb_torque_forward": 4e-4})]
    bench, pace = LiveBench(read_scene(scene_text([(ANALOG, "PulseServo", "")] * 2, SUPPLY))), random.Random(4)
    model = st.PulseServo(st.load_servo(ANALOG))
    lanes = st.VectorSimulator(model, lanes=2, load=_load(), bus=st.Supply(**SUPPLY), seed=5)
    lanes.reset(pulse_width=1.4e-3, output_angle=np.array(angles(bench)))
    torque, number = 0.0, {}
    bench.do("command", {"shape": "hold", "unit": "us", "value": 1400.0})
    for frame in range(50):
        time, width = frame / 50.0, 1.4e-3 if frame < 5 else 1.8e-3 if frame < 30 else 1.5e-3
        gone_on(bench, time, pace)
        if frame in (5, 30):
            bench.do("command", {"shape": "hold", "unit": "us", "value": 1e6 * width})
        for when, kind, value in changes:
            if math.isclose(when, time):
                bench.do(kind, value)
                torque = value if kind == "push" else torque
                number |= value if kind == "set" else {}
        if number:
            lanes.set(parameters=number)
        np.testing.assert_allclose(angles(bench), lanes["output_angle"], atol=1e-9)
        lanes.advance(0.02, pulse_width=width, external_torque=torque)
    bench.do("set", {"supply.internal_resistance": 3.0}, 1)  # the supply is one: it changes for both
    assert [one.servo.get("supply.internal_resistance") for one in bench.now_models] == [3.0, 3.0]


@pytest.mark.long
def test_how_time_is_cut_changes_nothing():
    def run(pace: random.Random) -> list[float]:
        bench = LiveBench(read_scene(scene_text([(ANALOG, "PulseServo", "")] * 3, SUPPLY)))
        for end, kind, value, servo in (
                (0.1, "command", {"shape": "hold", "unit": "us", "value": 1700.0}, None), (0.31, "push", 0.3, 0),
                (0.377, "set", {"supply.internal_resistance": 1.1}, None), (0.4, "set", {"gear.backlash": 0.01}, 1),
                (0.5003, "command", {"shape": "sine", "unit": "us", "mean": 1500.0, "amplitude": 200.0,
                                     "frequency": 2.0}, 2), (0.9, "push", 0.0, 0)):
            gone_on(bench, end, pace)
            bench.do(kind, value, servo)
        gone_on(bench, 1.3, pace)
        return angles(bench)

    np.testing.assert_allclose(run(random.Random(1)), run(random.Random(2)), atol=1e-9)


@pytest.mark.long
@pytest.mark.parametrize(("servos", "more"), CASES)
def test_kernels_show_what_plain_python_shows(servos, more, monkeypatch):
    """Also where the room for rows has to grow."""
    compiled = bus_run.kernels_beside
    monkeypatch.setattr(bus_run, "_ROOM", 64)
    kernels(bus_run.TOGETHER)

    def shown(way):
        monkeypatch.setattr(bus_run, "kernels_beside", way)
        bench, told = LiveBench(read_scene(scene_text(servos, SUPPLY | more))), []
        bench.hurried(lambda: False, told.append)
        bench.do("command", {"shape": "hold", "unit": "us", "value": 1800.0})
        seen = [bench.advance(0.5, 150.0)]
        bench.do("set", {"supply.internal_resistance": 0.8})
        analog = servos[0][0] == ANALOG
        bench.do("set", {"electronics.deadband": 2e-5} if analog else {"firmware.deadband_angle": 0.01}, 0)
        bench.do("push", 0.1)
        seen.append(bench.advance(0.6, 150.0))
        assert len(told) > (5 if way is compiled else 0)
        return type(bench._supply._steps._way), seen

    (way, found), (plainly, expected) = shown(compiled), shown(lambda recipe: None)
    assert (way, plainly) == (bus_run._ShownCompiled, bus_run._ShownPlainly)
    for push, plain in zip(found, expected, strict=True):
        assert [(kind, servo) for _, kind, servo in push.events] == [(kind, servo) for _, kind, servo in plain.events]
        for one, other in zip(push.servos, plain.servos, strict=True):
            assert one.pulses == other.pulses
            peak = np.maximum(np.abs(other.points).max(axis=0), 1e-6)
            np.testing.assert_allclose(np.array(one.points) / peak, np.array(other.points) / peak, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(("servos", "supply", "what"), [
    ([(ANALOG, "BoundedServo", "")], SUPPLY, "model of servo 1"),
    ([(ANALOG, "PulseServo", '"gear.stiffness" = 40.0')], SUPPLY, "servo 1 on a shared supply"),
    ([(ANALOG, "PulseServo", "")], {"internal_resistance": 0.5}, "supply of a scene"),
    ([(ANALOG, "PulseServo", "")], SUPPLY | {"volts": 6.0}, "supply of a scene"),
    ([(ANALOG, "PulseServo", "")], SUPPLY | {"internal_resistance": -1.0}, "internal_resistance")])
def test_what_cannot_share_is_told(servos, supply, what):
    with pytest.raises(InputError, match=what):
        LiveBench(read_scene(scene_text(servos, supply)))


@pytest.mark.parametrize("servos", [1, pytest.param(2, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("name", "supply", "torque"), SITUATIONS)
def test_the_least_voltage_shows_however_seldom_one_looks(name, supply, torque, servos):
    """Also between two ticks of a program: as it is to a hundredth of a millisecond without rows of its own."""
    source, kind = st.Supply.of(supply), "DigitalServo" if name in (STS, XL) else "PulseServo"
    volts = {key: value for key in ("open_circuit_voltage", "internal_resistance", "current_limit")
             if (value := getattr(source, key)) is not None}
    own = ", ".join(f'"supply.{key}" = {value}' for key, value in volts.items()) if servos == 1 else ""
    text = scene_text([(name, kind, own)] * servos, volts if servos > 1 else {}, "")
    text = text.replace("inertia = 2e-4", f"inertia = 2e-4\ntorque = {torque}")
    text = text if servos > 1 else text.replace("[supply]\n", "").replace("[supply]", "")
    goals, found = (30.0, 90.0) if name == BIG else (-30.0, 40.0), {}
    for rate, switches in ((37.0, True), (180.0, True), (1e5 if servos == 1 else 1e4, False)):
        bench, volts_seen = LiveBench(read_scene(text)), []
        bench.do("command", {"shape": "hold", "unit": "deg", "value": goals[0]})
        bench.advance(0.3, 100.0)
        bench.do("command", {"shape": "hold", "unit": "deg", "value": goals[1]})
        while bench.time < 0.4:
            at = bench.columns[0].index("bus_voltage")
            volts_seen += [row[at] for row in bench.advance(0.4, rate, switches=switches).servos[0].points]
        found[rate] = min(volts_seen)
    seldom, often, dense = found.values()
    assert seldom == pytest.approx(often, abs=1e-6)
    assert seldom <= dense + 1e-6
    assert dense - seldom < (0.002 if servos == 1 else 0.02)  # V falls by up to 200 V/s

"""`bench record` records a twin and `fit` finds it: in simulated time, so that no other process disturbs."""

import types
from functools import partial

import numpy as np
import pytest

import servotwin as st
from servotwin.bench.bus import BusRig, bus, sdk_wire
from servotwin.bench.bus.bus import Ticks
from servotwin.bench.recording import About, Limits, experiments, record
from wire_talk import STS

pytestmark = pytest.mark.long

pytest.importorskip("scservo_sdk", reason="feetech-servo-sdk is not installed")
FREE = ["output_torque_constant", "output_coulomb_torque", "output_inertia"]
LIMITS = Limits(kind="angle", low=-1.0, high=1.0, voltage=12.0, current=3.0)


class Stepped:
    """A bus as a backend of the bench, whose time goes on where somebody waits."""

    name = "stepped bus"

    def __init__(self, twins):
        self.twins, self._got = twins, b""
        self.time = types.SimpleNamespace(perf_counter=lambda: twins.time, sleep=self.go_on)

    def open(self):
        pass

    def close(self):
        pass

    def send(self, data):
        self.twins.write(data)

    def go_on(self, duration):
        self._got += self.twins.advance(max(duration, 0.0))

    def read(self, timeout):
        if not self._got:
            due = self.twins.due
            self.go_on(timeout if due is None else min(max(due - self.twins.time, 0.0) + 1e-7, timeout))
        found, self._got = self._got, b""
        return found


def recorded(servo, folder, monkeypatch, seed):
    backend = Stepped(st.wire.Bus({1: servo}, seed=seed))
    for module in (bus, sdk_wire):
        monkeypatch.setattr(module, "time", backend.time)
    monkeypatch.setattr(bus, "Ticks", partial(Ticks, clock=backend.time.perf_counter, sleep=backend.go_on))
    for one in experiments("steps,prbs", LIMITS, duration=4.0, frame_period=0.01, seed=seed):
        rig = BusRig(backend, "feetech", 1)
        rig.open()
        record(rig, one, folder / f"{one.name}.csv", limits=LIMITS, about=About(servo="twin"))
        rig.close()
    return st.read_logs(folder)


def test_the_log_is_that_of_the_twin(tmp_path, monkeypatch):
    logs = recorded(st.load_servo(STS), tmp_path, monkeypatch, 0)
    assert len(logs) == 2
    assert all(np.ptp(log.measured["output_angle"]) > 0.3 for log in logs)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_fit_finds_the_servo(seed, tmp_path, monkeypatch):
    truth = st.load_servo(STS)
    fit = st.identify(recorded(truth, tmp_path, monkeypatch, seed), truth, free=FREE, seed=seed)
    N = truth.get("gear.gear_reduction")
    right = {"output_torque_constant": N * truth.get("motor.torque_constant"),
             "output_coulomb_torque": N * truth.get("friction.coulomb_torque_forward"),
             "output_inertia": N**2 * truth.get("motor.rotor_inertia") + truth.get("gear.output_inertia")}
    for name, value in right.items():
        assert fit.intervals()[name].lower < value < fit.intervals()[name].upper
        assert fit.estimates[name] == pytest.approx(value, rel=0.05)

"""A bench to rehearse on: an emulated board, or a mock of it, beside a simulated servo."""

from __future__ import annotations

from typing import TYPE_CHECKING

from servotwin.bench.backends import EmulatedBackend, MockBackend
from servotwin.bench.emulator.plant import ServoOnPins, fronts_of
from servotwin.bench.emulator.process import harness
from servotwin.bench.recording.analog_rig import AnalogRig
from servotwin.errors import BenchError

if TYPE_CHECKING:
    from servotwin.bench.backends import Backend
    from servotwin.bench.recording.bench_wiring import Wiring
    from servotwin.loads import Load
    from servotwin.models import Model


def rehearsal_board(model: Model, load: Load, wiring: Wiring, *, mock: bool = False, noise: float = 1e-3,
                    seed: int = 0, real_time: bool = False) -> tuple[Backend, str]:
    """Return a board with a simulated servo on it, and what is to be said of it, mostly nothing.

    Parameters
    ----------
    model : Model
        `PulseServo`, `PulseServoInductive` or `DigitalServo`.
    load : Load
    wiring : Wiring
        Its numbers are taken for true: the emulated pins are wired so.
    mock : bool
        A board in Python instead of the firmware. It is taken, and said, where simavr is not installed.
    noise : float
        At each pin, one standard deviation [V].
    seed : int
    real_time : bool
        Whether it goes no faster than the clock on the wall; a mock cannot.

    Raises
    ------
    InputError
        If a number makes no sense, or the model takes no pulses.
    """
    plant = ServoOnPins(model, load, fronts=fronts_of(wiring), noise=noise, seed=seed)
    references = {wiring.reference: wiring.pin_voltage(1023.5)}
    remark = ""
    if not mock:
        try:
            harness()
        except BenchError as error:
            if real_time:
                raise
            mock, remark = True, f"a mock of the board is used instead of its firmware: {error.problem}"
    if mock:
        return MockBackend(plant, references=references), remark
    return EmulatedBackend(plant, references=references, real_time=real_time), remark


def rehearsal_rig(model: Model, load: Load, wiring: Wiring, *, rate: str = "fast", mock: bool = False,
                  noise: float = 1e-3, seed: int = 0) -> tuple[AnalogRig, str]:
    """Return a rig with a simulated servo on it, and what is to be said of it; arguments as of `rehearsal_board`.

    Parameters
    ----------
    model, load, wiring, mock, noise, seed
        As of `rehearsal_board`.
    rate : {"fast", "frame"}
    """
    backend, remark = rehearsal_board(model, load, wiring, mock=mock, noise=noise, seed=seed)
    return AnalogRig(backend, wiring, rate=rate), remark

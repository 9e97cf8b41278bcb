"""`simulate`: a run of one servo from start to end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from servotwin.errors import InputError, SimulationError
from servotwin.models.engine.memory import ACCURACY
from servotwin.simulation.engine import RunLog
from servotwin.simulation.oddities import warn_of
from servotwin.simulation.progress import Progress, shown
from servotwin.simulation.result import Result
from servotwin.simulation.simulator import Simulator
from servotwin.simulation.status import Status
from servotwin.simulation.times import times_asked
from servotwin.simulation.trajectory import Motions, Trajectory
from servotwin.units import is_finite

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from servotwin.loads import Load, Part
    from servotwin.models import Model
    from servotwin.signals import Signal

_THOUSAND = 1000  # parts of a run, of which progress tells


def simulate(model: Model, command: Signal, *, duration: float, load: Load | Part | None = None,
             output_step: float | None = None, output_times: ArrayLike | None = None,
             initial: Mapping[str, float] | None = None, seed: int = 0, progress: Progress = False,
             accuracy: float = ACCURACY) -> Result:
    """Simulate from t = 0 to `duration` and return the result.

    Parameters
    ----------
    model : Model
    command : Signal
    duration : float
        Positive [s].
    load : Load, optional
        Nothing unless given.
    output_step : float, optional
        Distance of the output times [s], 1 ms unless given; outputs at 0, output_step, …, duration. It changes
        nothing but where the solution is shown.
    output_times : array_like, shape (n,), optional
        Output times instead [s], from 0 to `duration`, not decreasing.
    initial : mapping, optional
        Initial values by state name (SI), see `Simulator.initial`.
    seed : int
        Seed of all noise.
    progress : bool or callable
        True shows a bar for what lasts over a second; a callable is called with the thousandths that are done and 1000.
    accuracy : float
        Of what is integrated, as in `Simulator` [rad].

    Raises
    ------
    InputError
        On bad input only; a run that ends early says so in `Result.status`.

    Warns
    -----
    UserWarning
        If the servo's data sheet is impossible, its supply more than twice that of the sheet, or the command changes
        only after the end.

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.BoundedServo(st.load_servo("hitec-hs-755hb"))
    >>> result = st.simulate(model, st.signals.step(0.0, 90.0, at=0.1, unit="deg"), duration=1.0)
    >>> result["output_angle"].shape
    (1001,)
    """
    if not (is_finite(duration) and duration > 0.0):
        raise InputError("duration", got=duration, allowed="a positive number of seconds")
    times = times_asked(duration, output_step, output_times)
    simulator = Simulator(model, load, seed, accuracy)
    simulator.drive(command)  # raises if the model cannot follow it
    warn_of(model.servo, [command], duration)
    return simulated(simulator, model.framed(command, duration), duration, times, initial, progress)


def simulated(simulator: Simulator, command: Signal, duration: float, times: NDArray[np.float64],
              initial: Mapping[str, float] | None, progress: Progress = False) -> Result:
    """Return what `simulate` does, of arguments that it has looked at."""
    status, ended, cause = Status.COMPLETED, duration, Status.COMPLETED.message
    with shown(progress, _THOUSAND, "simulating") as show:
        record = RunLog(_thousandths(duration, show) if progress else None)
        try:
            simulator.recorded(simulator.initial(command, initial), duration, command, record)
        except SimulationError as error:
            status, ended, cause = Status[error.status], error.time, error.cause
    return Result(model=simulator.model, command=command, load=simulator.load, drive=simulator.drive(command),
                  time=times, trajectory=Trajectory(Motions(record.parts)), events=tuple(record.events),
                  status=status, ended=ended, cause=cause)


def _thousandths(duration: float, show: Callable[[int], None]) -> Callable[[float], None]:
    """Return what shows the thousandths of the duration, each once."""
    last = 0

    def tell(time: float) -> None:
        nonlocal last
        done = int(_THOUSAND * time / duration)
        if done > last:
            last = done
            show(done)
    return tell

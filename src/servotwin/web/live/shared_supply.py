"""Servos of a bench that hang on one supply: its voltage joins them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from servotwin.errors import InputError
from servotwin.loads import Load
from servotwin.parameters.groups import Supply
from servotwin.simulation.bus_steps import BusSteps
from servotwin.simulation.bus_supply import MODEL_NAMES, MODELS, check_rigid, check_supply, on_supply, source_of
from servotwin.simulation.bus_voltage import BusVoltage
from servotwin.web.live.station import Seen, Station, with_switches

if TYPE_CHECKING:
    from collections.abc import Mapping

    from servotwin.models import Model


class SharedSupply:
    """The supply that all stations of a bench hang on; what it is, the servo of each of them says alike.

    Parameters
    ----------
    stations : sequence of Station
        Of models that `hung` has returned.
    """

    def __init__(self, stations: Sequence[Station]) -> None:
        self._stations, self._steps = stations, BusSteps()

    def advance(self, until: float, times: Sequence[float], *, switches: bool = True) -> list[Seen]:
        """Let all go on to a time [s]; return what shows of each, as `Station.advance` does.

        Raises
        ------
        SimulationError
            If they cannot go on.
        """
        those = self._stations
        plans, source = [one.plan for one in those], source_of(those[0].model.servo.supply)
        stretch = self._steps.go_on(source, plans, [one.state for one in those], until, those[0].tell)
        runs = list(zip(those, plans, stretch.segments, stretch.events, strict=True))
        switched = {time for one, _, segments, _ in runs for time in one.switched(segments)} if switches else set()
        looked = with_switches(times, sorted(switched))
        bus = BusVoltage(source, len(those))
        standing = [one.states(segments, looked) for one, _, segments, _ in runs]
        volts = [bus.under(plans, places) for places in zip(*standing, strict=True)]
        for one, state in zip(those, stretch.states, strict=True):
            one.state = state
        return [one.seen(plan, segments, events, looked, volts) for one, plan, segments, events in runs]


def hung(models: Sequence[Model], load: Load, supply: Mapping[str, float]) -> tuple[Model, ...]:
    """Return models as they are on a supply that they share.

    Parameters
    ----------
    models : sequence of Model
    load : Load
        Of each of them.
    supply : mapping
        Numbers of the group `supply` (SI).

    Raises
    ------
    InputError
        If one of them cannot be, or the supply is none.
    """
    shared = Supply(**supply)
    check_supply("supply of a scene", shared)
    found = []
    for k, model in enumerate(models):
        if not isinstance(model, MODELS):
            raise InputError(f"model of servo {k + 1} on a shared supply", got=type(model).__name__,
                             allowed=MODEL_NAMES)
        found.append(on_supply(model, shared))
        check_rigid(f"servo {k + 1} on a shared supply", found[-1].plant(load).elastic)
    return tuple(found)

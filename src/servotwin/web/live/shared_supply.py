"""Servos of a bench that hang on one supply: its voltage joins them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from servotwin.errors import InputError
from servotwin.loads import Load
from servotwin.models.engine.live.screen import Looks, first_look
from servotwin.parameters.groups import Supply
from servotwin.simulation.bus import MODEL_NAMES, MODELS, check_rigid, check_supply, on_supply, source_of
from servotwin.simulation.bus_run import BusSteps
from servotwin.web.live.station import Endless, Seen, Station

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
        self._stations, self._steps = stations, BusSteps([one.post for one in stations])

    def advance(self, until: float, rate: float, *, switches: bool = True) -> list[Seen]:
        """Let all go on to a time [s]; return what shows of each, as `Station.advance` does.

        Raises
        ------
        SimulationError
            If they cannot go on.
        """
        those = self._stations
        rows, events = [Endless(one.tell) for one in those], [Endless() for _ in those]
        looks = Looks(first_look(those[0].state.time, rate), rate, until, 1, int(switches))
        states = self._steps.go_on(source_of(those[0].model.servo.supply), [one.plan for one in those],
                                   [one.state for one in those], looks, rows, events)
        for one, state in zip(those, states, strict=True):
            one.state = state
        return [one.seen(*shown) for one, *shown in zip(those, rows, events, strict=True)]


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

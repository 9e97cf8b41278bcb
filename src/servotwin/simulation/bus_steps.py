"""Servos on one supply that stop and go on, in plain Python, and are looked at on the way: what is shown live."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from servotwin.errors import InputError
from servotwin.models.engine import controller
from servotwin.models.engine.live import together
from servotwin.models.engine.live.posts import put_low
from servotwin.models.engine.live.screen import NEXT, NO_LOW, USED, Looks
from servotwin.models.engine.step import COMPLETED, DIVERGED
from servotwin.models.terms import control
from servotwin.models.terms.source import Source
from servotwin.simulation.bus_run import Plainly, tape_of
from servotwin.simulation.engine import Plan, State, failure
from servotwin.simulation.status import Status


class BusSteps:
    """Servos on one supply that stop and go on.

    Splitting an interval into several calls changes nothing beyond rounding.

    Parameters
    ----------
    posts : sequence
        What shows of each servo, as `models.engine.live.posts.Post` has it.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.simulation.bus_supply import on_supply, source_of
    >>> from servotwin.web.live.station import Endless, post_of
    >>> supply = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.5)
    >>> sim = st.Simulator(on_supply(st.PulseServo(st.load_servo("hitec-hs-755hb")), supply))
    >>> command = st.signals.step(0.0, 60.0, unit="deg")
    >>> steps, states = BusSteps([post_of(sim.model), post_of(sim.model)]), [sim.initial(command), sim.initial(command)]
    >>> for until in (0.1, 0.15, 0.2):
    ...     shown = [Endless() for _ in states], [Endless() for _ in states]
    ...     states = steps.go_on(source_of(supply), [sim.plan(command)] * 2, states, Looks(1, 1e3, until, 1, 0), *shown)
    >>> fleet = st.simulate_bus({"a": (sim.model, command), "b": (sim.model, command)}, supply=supply, duration=0.2)
    >>> abs(states[1]["output_angle"] - float(fleet["b"]["output_angle"][-1])) < 1e-12
    True
    """

    def __init__(self, posts: Sequence[Any]) -> None:
        self._posts = posts
        self._way: Plainly | None = None
        self._source: Source | None = None

    def go_on(self, source: Source, plans: Sequence[Plan], states: Sequence[State], looks: Looks,
              rows: Sequence[Any], events: Sequence[Any]) -> list[State]:
        """Let all servos go on to the end of the looks; return their states there.

        Parameters
        ----------
        source : Source
            That they share.
        plans, states : sequence of Plan, of State
            Of the servos, always in the same order.
        looks : Looks
        rows, events : sequence
            Room for what shows of each.

        Raises
        ------
        SimulationError
            If the run cannot go on.
        """
        way = self._begun(source, plans, states)
        used = np.zeros(USED * len(plans), np.int64)
        used[NEXT] = looks.next
        put_low(self._posts[0].low, NO_LOW)
        firms = way.seated()
        try:
            status = together.go_on(way.inputs, self._posts, firms, way.shared, way.seats, way.mates, looks, self._tape,
                                    rows, events, used)
        except InputError:
            raise  # of whoever is told the time
        except (ArithmeticError, ValueError):  # numbers beyond what a float holds
            status = DIVERGED
        for j, own in enumerate(rows):
            own.cut(int(used[USED * j]))
        way.risen(firms)
        if status != COMPLETED:
            raise failure(Status.of_code(status), max(seat.origin + seat.clock for seat in way.seats))
        return self._states(way, plans, states, looks.until)

    def _begun(self, source: Source, plans: Sequence[Plan], states: Sequence[State]) -> Plainly:
        if self._way is None:
            self._way, self._tape = Plainly(plans, states, source), tape_of(len(plans), True)
        else:
            self._way.begin(plans, states)
            if source != self._source or self._are_others(self._way, plans, states):
                self._way.break_up(source)
        self._source = source
        return self._way

    @staticmethod
    def _are_others(way: Plainly, plans: Sequence[Plan], states: Sequence[State]) -> bool:
        """Tell whether numbers of a servo are others than before, or its clock is."""
        return any(plan.numbers != state.numbers or memory.beat != state.memory.beat
                   for plan, state, memory in zip(plans, states, way.memories, strict=True))

    @staticmethod
    def _states(way: Plainly, plans: Sequence[Plan], states: Sequence[State], until: float) -> list[State]:
        found = []
        for plan, state, memory in zip(plans, states, way.memories, strict=True):
            if plan.digital:
                controller.pause(plan.inputs, memory)
                memory = memory._replace(firm=(control.frozen(memory.firm[0]),))
            found.append(State(until, state.places, memory, plan.numbers, state.changes))
        return found

"""What tests cost: processor time of each item, its children's and that of compiling apart, over a calibration loop.

Wall time depends on what else a machine does, processor time on how fast it is: each process times a short loop now
and then, and what its items took is divided by the median of these. One second here is a second of the processor that
`budgets.toml` was written on.
"""

from __future__ import annotations

import gc
import json
import os
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

import pytest

from servotwin.simulation.compile import building, library
from servotwin.simulation.recipes import all_recipes

BUDGETS = tomllib.loads(Path(__file__).with_name("budgets.toml").read_text(encoding="utf-8"))
RECIPES = {recipe.name for recipe in all_recipes()}
_LOOP = 200_000  # turns, about 11 ms
_EVERY = 10.0  # s of processor time between two calibrations


def calibration() -> float:
    """Return the processor time of the loop, in s."""
    started = time.process_time()
    total = 0
    for turn in range(_LOOP):
        total += turn * turn
    return time.process_time() - started


def spent() -> tuple[float, float]:
    """Return the processor time of this process, and of its children that have ended, in s."""
    times = os.times()  # where there is no fork, children have none
    return time.process_time(), times.children_user + times.children_system


class Booking:
    """In each process that runs items: books processor time on the reports of their phases."""

    def __init__(self, config: pytest.Config) -> None:
        self.config = config
        self.loop = calibration()
        self.calibrated = time.process_time()
        self.made: list[tuple[str, float]] = []  # kernels: name and s
        self.used: set[str] = set()
        self.now, self.collected = spent(), 0.0
        self._watch()

    def _watch(self) -> None:
        """Book what kernels take that this process makes, and which ones it asks for something."""
        make, begin, get = building._made, library.Kernels.__init__, library.Kernels.__getattribute__

        def timed(recipe: Any, *others: Any) -> Any:
            before = sum(spent())
            try:
                return make(recipe, *others)
            finally:
                self.made.append((recipe.name, sum(spent()) - before))

        def begun(kernels: Any, recipe: Any, *others: Any) -> None:
            kernels._name = recipe.name
            begin(kernels, recipe, *others)

        def got(kernels: Any, name: str) -> Any:
            if name[0] != "_":
                self.used.add(get(kernels, "_name"))
            return get(kernels, name)

        building._made, library.Kernels.__init__, library.Kernels.__getattribute__ = timed, begun, got

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        limit = self.config.getoption("--cpu-limit")
        if limit is not None and sum(spent()) - self.collected > limit:
            item.session.shouldstop = f"{limit:g} s of processor time are used up"
        if time.process_time() - self.calibrated > _EVERY:
            self.loop = calibration()
            self.calibrated = time.process_time()
        self.now = spent()
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self) -> Iterator[None]:
        report = yield
        now = spent()
        report.cost = {"own": now[0] - self.now[0], "children": now[1] - self.now[1], "loop": self.loop,
                       "made": self.made, "used": sorted(self.used)}
        self.now, self.made, self.used = now, [], set()
        return report

    @pytest.hookimpl(trylast=True)
    def pytest_collection_finish(self) -> None:
        """Book what it took to import all tests, as nobody's cost; nobody looks for garbage among them any more."""
        gc.collect()
        gc.freeze()
        self.collected = sum(spent())
        if hasattr(self.config, "workeroutput"):
            self.config.workeroutput["collecting"] = sum(spent())
        else:
            self.config.collecting = sum(spent())


class Table:
    """Where reports come together: sums over folders, the longest items, and the verdict on budgets."""

    def __init__(self, config: pytest.Config) -> None:
        self.config = config
        self.items: dict[str, dict[str, Any]] = {}
        self.loops: list[float] = []
        self.collecting: list[float] = []
        self.over: list[str] = []

    def pytest_runtest_logreport(self, report: Any) -> None:
        cost = getattr(report, "cost", None)
        if cost is None:
            return
        item = self.items.setdefault(report.nodeid, {"own": 0.0, "children": 0.0, "made": [], "used": []})
        item["own"] += cost["own"]
        item["children"] += cost["children"]
        item["made"] += cost["made"]
        item["used"] = sorted({*item["used"], *cost["used"]})
        self.loops.append(cost["loop"])

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        self.collecting.append(getattr(node, "workeroutput", {}).get("collecting", 0.0))

    # --- the table --------------------------------------------------------------------------------------------------

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Weigh what was booked; a folder beyond twice its budget fails where the variable CI is set."""
        if not self.items:
            return
        self.collecting = self.collecting or [getattr(self.config, "collecting", 0.0)]
        self.scale = BUDGETS["loop"] / median(self.loops)
        self.folders: dict[str, list[float]] = {}
        for name, item in self.items.items():
            compiling = sum(took for _, took in item["made"])
            row = self.folders.setdefault(_folder(name), [0, 0.0, 0.0])
            row[0] += 1
            row[1] += max(item["own"] + item["children"] - compiling, 0.0) * self.scale
            row[2] += item["children"] * self.scale
        asked = self.config.getoption("--budgets")
        self.budgets: dict[str, float] = BUDGETS.get(asked, {})
        self.over = [name for name, row in self.folders.items() if row[1] > 2 * self.budgets.get(name, float("inf"))]
        if self.over and os.environ.get("CI") and session.exitstatus == 0:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED
        file = self.config.getoption("--costs")
        if file:
            said = {"scale": self.scale, "collecting": self.collecting, "items": self.items}
            Path(file).write_text(json.dumps(said), encoding="utf-8")

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        if len(self.items) < 2:
            return
        write = terminalreporter.write_line
        terminalreporter.write_sep("-", "processor seconds, calibrated")
        write(f"{'folder':32} {'items':>6} {'s':>8} {'children':>9} {'budget':>7}")
        for name, (count, took, children) in sorted(self.folders.items(), key=lambda row: -row[1][1]):
            budget = self.budgets.get(name)
            said = "" if budget is None else f"{budget:7.0f}"
            if budget is not None and took > 1.25 * budget:
                said += f"  {took / budget:.2f} times its budget"
            write(f"{name:32} {count:6.0f} {took:8.1f} {children:9.1f} {said}".rstrip())
        made = sorted(((took * self.scale, kernel) for item in self.items.values() for kernel, took in item["made"]),
                      reverse=True)
        total, making = sum(row[1] for row in self.folders.values()), sum(took for took, _ in made)
        write(f"all {total:.0f} s; beside them collecting {sum(self.collecting) * self.scale:.0f} s, "
              f"{len(made)} kernels made {making:.0f} s; a second here is {1 / self.scale:.2f} s of this machine")
        longest = sorted(((item["own"] + item["children"] - sum(took for _, took in item["made"])) * self.scale, name)
                         for name, item in self.items.items())[:-11:-1]
        for took, name in longest:
            write(f"{took:8.2f} s  {name}")
        for took, kernel in made[:5]:
            write(f"{took:8.2f} s  to make {kernel}")
        if self.config.getoption("--budgets") == "quick":
            used = {kernel for item in self.items.values() for kernel in item["used"]} & RECIPES
            for kernel in sorted(used - set(BUDGETS["kernels"]["quick"])):
                names = [name for name, item in self.items.items() if kernel in item["used"]]
                write(f"{kernel} is none of the kernels of quick tests: {names[0]} and {len(names) - 1} more use it")
        for name in self.over:
            write(f"{name} takes over twice its budget of {self.budgets[name]:.0f} s (tests/budgets.toml)")


def _folder(name: str) -> str:
    """Return the folder that an item is booked on: a room of tests, or all of src/."""
    parts = name.split("::")[0].split("/")
    return "src" if parts[0] == "src" else "/".join(parts[:2]) if len(parts) > 2 else parts[0]


def add_options(parser: pytest.Parser) -> None:
    group = parser.getgroup("costs")
    group.addoption("--costs", metavar="FILE", help="write the cost of each item to a file (JSON)")
    group.addoption("--cpu-limit", type=float, metavar="SECONDS", help="stop when items have used up so much time")
    group.addoption("--budgets", metavar="NAME", help="hold folders against these budgets of tests/budgets.toml")


def begin(config: pytest.Config) -> None:
    """Book costs; items run in the workers where there are some."""
    worker = hasattr(config, "workerinput")
    if worker or not getattr(config.option, "numprocesses", None):
        config.pluginmanager.register(Booking(config), "booking")
    if not worker:
        config.pluginmanager.register(Table(config), "table of costs")

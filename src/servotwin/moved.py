"""Documented import paths of modules that have moved: for a release they still lead to the new place, and warn."""

import sys
from importlib.machinery import ModuleSpec

TYPE_CHECKING = False  # typing is slow to load
if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import ModuleType

MOVED = {  # to be removed in 0.2
    "servotwin.bench.emulator.paper_chain": "servotwin.bench.emulator.plant",
    "servotwin.robots.arm": "servotwin.robots.arms.arm",
    "servotwin.robots.comparison": "servotwin.robots.arms.task_run",
    "servotwin.robots.controlled": "servotwin.robots.arms.controllers",
    "servotwin.robots.controllers": "servotwin.robots.arms.controllers",
    "servotwin.robots.kinematics": "servotwin.robots.arms.tasks",
    "servotwin.robots.redundancy": "servotwin.robots.arms.tasks",
    "servotwin.robots.steering": "servotwin.robots.arms.controllers",
    "servotwin.robots.task_run": "servotwin.robots.arms.task_run",
    "servotwin.robots.tasks": "servotwin.robots.arms.tasks",
}
"""Old name -> new name."""


class Forwarding:
    """Finds modules by their old names: each has what the one at the new place has."""

    @staticmethod
    def find_spec(name: str, path: "Sequence[str] | None" = None, target: "ModuleType | None" = None,
                  ) -> ModuleSpec | None:
        """Return how a module is loaded that has moved; None for all others."""
        return ModuleSpec(name, Forwarding) if name in MOVED else None  # type: ignore[arg-type]

    @staticmethod
    def create_module(spec: ModuleSpec) -> None:
        """Leave it to Python to make the module."""

    @staticmethod
    def exec_module(module: "ModuleType") -> None:
        """Let a module have what the new one has, and warn of its name."""
        import warnings
        from importlib import import_module

        new = import_module(MOVED[module.__name__])
        warnings.warn(f"{module.__name__} has moved to {new.__name__}; the old name goes in 0.2", DeprecationWarning,
                      stacklevel=2)
        module.__dict__.update({name: value for name, value in vars(new).items() if not name.startswith("__")})


def install() -> None:
    """Look for moved modules where no others are found."""
    if Forwarding not in sys.meta_path:
        sys.meta_path.append(Forwarding)

"""The bench in the browser: what its text says, how it is repeated, and the server of its page."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from servotwin.web.live import Replayed, Scene, read_scene, replay

_LAZY = {"Replayed": "live", "Scene": "live", "read_scene": "live", "replay": "live"}

__all__ = ["Replayed", "Scene", "read_scene", "replay"]


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(import_module(f"servotwin.web.{_LAZY[name]}"), name)
    raise AttributeError(f"module 'servotwin.web' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)

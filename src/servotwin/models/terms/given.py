"""What a term asks of a model to get its numbers."""

from __future__ import annotations

from typing import Any, Protocol


class Given(Protocol):
    """The parameters of a servo by dotted name (SI), each a number or a column of lanes."""

    @property
    def servo(self) -> Any:
        """The servo, whose `get` returns None where it does not give a value."""

    def value(self, name: str) -> float:
        """Return a parameter that is there."""

    def value_or(self, name: str, default: float) -> float:
        """Return a parameter, or the default where it is not there."""

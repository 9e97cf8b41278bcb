"""Loads on the output shaft: frozen parts that add up to one `Load`.

    load = Inertia(1e-3) + Viscous(1e-4) + Constant(0.1) + Pendulum(mass=0.1, length=0.12)

A positive external torque pushes the shaft towards −q (docs/theory).
"""

from servotwin.loads.load import (
    Constant,
    Coulomb,
    Flexible,
    Free,
    Inertia,
    Load,
    Part,
    Pendulum,
    Recorded,
    Spring,
    Viscous,
    as_load,
)

__all__ = [
    "Constant", "Coulomb", "Flexible", "Free", "Inertia", "Load", "Part", "Pendulum", "Recorded", "Spring", "Viscous",
    "as_load",
]

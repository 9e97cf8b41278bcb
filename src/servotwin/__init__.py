"""servotwin: the digital twin of an RC servo, from a pulse in microseconds to the torque at the horn.

Importing the package loads numpy alone; every other part is loaded when its name is first used.
"""

from importlib import import_module

from servotwin.moved import install as _install

TYPE_CHECKING = False  # typing is slow to load
if TYPE_CHECKING:
    from typing import Any

__version__ = "0.1.0"
_install()

# public name -> module that defines it
_LAZY = {
    **dict.fromkeys(("Servo", "catalog_names", "dynamixel_ax", "dynamixel_mx", "dynamixel_x", "dynamixel_xl320",
                     "feetech_sts", "load_dataset", "load_servo", "servo_from_values", "Supply"), "parameters"),
    **dict.fromkeys(
        ("AveragedServo", "AveragedServoInductive", "BoundedServo", "DCMotor", "DigitalServo", "GearedMotor",
         "PulseServo", "PulseServoInductive"), "models"),
    **dict.fromkeys(("Batch", "Fleet", "Result", "Simulator", "State", "Status", "grid", "simulate", "simulate_bus",
                     "simulate_many", "VectorSimulator"), "simulation"),
    **dict.fromkeys(("DataSheet", "curves", "servos_that_lift"), "datasheet"),
    "Diagnosis": "diagnosis", "diagnose": "diagnosis",
    **dict.fromkeys(("Study", "distributions", "sweep"), "studies"),
    **dict.fromkeys(("Log", "read_logs"), "logs"),
    **dict.fromkeys(("Fit", "Sheet", "SheetPoint", "advise", "friction_ladder", "identify", "servo_from_sheet",
                     "validate"), "identification"),
}
_MODULES = ("bench", "control", "datasheet", "diagnosis", "errors", "export", "identification", "linear", "loads",
            "logs", "models", "parameters", "physics", "plotting", "robots", "signals", "simulation", "studies",
            "units", "web", "wire")

__all__ = ["__version__", *_LAZY, *_MODULES]


def __getattr__(name: str) -> "Any":
    if name in _MODULES:
        return import_module(f"servotwin.{name}")
    if name in _LAZY:
        return getattr(import_module(f"servotwin.{_LAZY[name]}"), name)
    raise AttributeError(f"module 'servotwin' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)

"""One final class per fidelity; each joins a servo's parameters to the laws that it uses."""

from servotwin.models.averaged import AveragedServo, AveragedServoInductive
from servotwin.models.base import Model
from servotwin.models.bounded import BoundedServo
from servotwin.models.default import default_class, default_model
from servotwin.models.digital import DigitalServo
from servotwin.models.motors import DCMotor, GearedMotor
from servotwin.models.pulse import PulseServo, PulseServoInductive
from servotwin.models.standing import mid_travel

MODELS: dict[str, type[Model]] = {
    "dc-motor": DCMotor,
    "geared-motor": GearedMotor,
    "averaged": AveragedServo,
    "averaged-inductive": AveragedServoInductive,
    "bounded": BoundedServo,
    "pulse": PulseServo,
    "pulse-inductive": PulseServoInductive,
    "digital": DigitalServo,
}

__all__ = ["MODELS", "AveragedServo", "AveragedServoInductive", "BoundedServo", "DCMotor", "DigitalServo",
           "GearedMotor", "Model", "PulseServo", "PulseServoInductive", "default_class", "default_model", "mid_travel"]

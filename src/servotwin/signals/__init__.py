"""Commands: signals as tables of pieces, in SI inside, with the unit of the caller at the edge."""

from servotwin.signals.shapes import chirp, constant, from_csv, prbs, pulse_train, ramp, samples, sine, step
from servotwin.signals.signal import Signal

__all__ = ["Signal", "chirp", "constant", "from_csv", "prbs", "pulse_train", "ramp", "samples", "sine", "step"]

"""Experiments, the rigs that they run on, and the recorder that writes their logs."""

from servotwin.bench.recording.analog_rig import AnalogRig
from servotwin.bench.recording.bench_wiring import Calibration, Wiring, calibrated, load_wiring, nominal_wiring
from servotwin.bench.recording.experiment import EXPERIMENTS, Experiment, Hold, Limits, experiments, of_log
from servotwin.bench.recording.recorder import About, Recorded, Rig, record, record_bus, watched_current

__all__ = ["EXPERIMENTS", "About", "AnalogRig", "Calibration", "Experiment", "Hold", "Limits", "Recorded", "Rig",
           "Wiring", "calibrated", "experiments", "load_wiring", "nominal_wiring", "of_log", "record", "record_bus",
           "watched_current"]

"""Linear views of the models, as python-control systems; and their answers to sines of a finite size, simulated."""

from servotwin.linear.frequency_response import FrequencyResponse, frequency_response
from servotwin.linear.gain_search import Tuning, tune
from servotwin.linear.linearise import Linearised, linearise
from servotwin.linear.sampled import Margins, SampledServo, sampled
from servotwin.linear.transfer_function import state_space, transfer_function

__all__ = [
    "FrequencyResponse", "Linearised", "Margins", "SampledServo", "Tuning", "frequency_response", "linearise",
    "sampled", "state_space", "transfer_function", "tune",
]

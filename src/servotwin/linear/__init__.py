"""Linear views of the models, as python-control systems; and their answers to sines of a finite size, simulated."""

from servotwin.linear.frequency_response import frequency_response
from servotwin.linear.linearise import Linearised, linearise
from servotwin.linear.response import FrequencyResponse
from servotwin.linear.sampled import Margins, SampledServo, sampled
from servotwin.linear.state_space import state_space
from servotwin.linear.transfer_function import transfer_function
from servotwin.linear.tuning import Tuning, tune

__all__ = [
    "FrequencyResponse", "Linearised", "Margins", "SampledServo", "Tuning", "frequency_response", "linearise",
    "sampled", "state_space", "transfer_function", "tune",
]

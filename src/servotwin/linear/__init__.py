"""Linear views of the models, as python-control systems; and their answers to sines of a finite size, simulated."""

from servotwin.linear.frequency_response import frequency_response
from servotwin.linear.response import FrequencyResponse
from servotwin.linear.transfer_function import transfer_function

__all__ = ["FrequencyResponse", "frequency_response", "transfer_function"]

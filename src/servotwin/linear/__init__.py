"""Linear views of the models, as python-control systems."""

from servotwin.linear.transfer_function import transfer_function

__all__ = ["transfer_function"]

"""The search of a fit: its numbers, the forecast of logs, assignments of pulses, least squares."""

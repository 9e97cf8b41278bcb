"""The board without a board: its firmware on an emulated microcontroller, in lockstep with a simulated servo."""

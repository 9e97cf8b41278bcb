"""What another simulator does between ticks: it imposes states, reads signals, changes numbers."""

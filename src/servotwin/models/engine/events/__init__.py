"""What ends a mode, and when."""

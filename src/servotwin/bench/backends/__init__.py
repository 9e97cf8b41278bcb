"""What carries bytes to a bench and back."""

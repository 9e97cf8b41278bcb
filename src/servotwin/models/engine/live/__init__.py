"""Servos at a bench that is looked at while it goes on; one text for Python and WebAssembly."""

"""Servos at a bench that is looked at while it runs; one text for Python and WebAssembly."""

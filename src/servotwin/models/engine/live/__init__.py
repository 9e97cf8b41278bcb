"""Servos at a bench that is looked at while it goes on: what shows of them at each look, one text for Python and wasm."""

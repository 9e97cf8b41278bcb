"""What visitors bring: a log of their own, its twin beside it, and a fit, each computed in a process of its own."""

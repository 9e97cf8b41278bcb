"""Many servos side by side: windows of frames, ticks of programs, and a form for each kind of law."""

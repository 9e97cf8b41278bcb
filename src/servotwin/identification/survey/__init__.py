"""What a log says by itself, without a servo and without a fit."""

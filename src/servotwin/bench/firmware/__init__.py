"""The firmware of the bench, as it is flashed."""

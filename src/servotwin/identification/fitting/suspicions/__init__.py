"""What can be wrong with a log and shows without a fit: one check a file."""

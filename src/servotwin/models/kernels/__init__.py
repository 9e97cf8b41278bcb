"""The models' modes as plain functions over floats; they know `math` and nothing else."""

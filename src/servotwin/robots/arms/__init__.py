"""The arms of the paper: their tools follow paths, under controllers."""

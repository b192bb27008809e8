"""The systems, one to a file: each takes part in any diagram and knows none."""

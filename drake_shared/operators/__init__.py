"""Simulated operators as arithmetic: parameters, steering, and the named ones."""

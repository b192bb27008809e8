"""Demonstrations: trajectories, their scores and sampling weights, their files, and progress along them."""

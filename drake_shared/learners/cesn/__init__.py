"""The context-based echo state network (CESN): reservoir, training, and prediction in numpy."""

"""The conditional neural movement primitive (CNMP): network, training, and prediction in numpy."""

"""Who decides, as arithmetic: authority, and the safety filter."""

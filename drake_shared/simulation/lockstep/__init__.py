"""Many trials at once: arrays over trials in place of a diagram for each."""

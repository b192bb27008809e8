"""A consistency model of demonstrated actions, which one step denoises; it is not a `Learner`."""

"""The diagram, a trial in it, its log, and the runner for many tasks."""

"""How fast it all is, beside what a user would pick instead: each figure a ratio measured within one run."""

"""Figures from logs: metrics, evaluation of learners, counterfactuals, lineage, replay and statistics."""

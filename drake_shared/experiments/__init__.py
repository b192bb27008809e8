"""The experiments of Amirshirzad et al. 2022 and those around them: tasks, and sections of a report.

Every operator in them is simulated.
"""

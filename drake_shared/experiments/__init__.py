"""The experiments of Amirshirzad et al. 2022 and those around them, each as tasks and as a section of a report.

Every operator in them is simulated.
"""

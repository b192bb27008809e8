"""The experiments of Amirshirzad et al. 2022 and further ones, and their report.

All operators are simulated. An experiment is a module with an ``EXPERIMENT``: its ``plan`` lists tasks, and
its ``report`` turns their results into a section whose text is in ``templates/``.
"""

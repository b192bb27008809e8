"""Arithmetic of the safety filter: a discrete-time control barrier function with full braking as the backup.

A command is safe if the robot, after one period of it, can brake to rest and keep a set clearance to every
obstacle. `barrier` finds the safe command nearest to a given one, from the paths of a braking robot
(`braking_paths`), lower bounds of its gaps to obstacles (`gap_bounds`) and predictions of moving obstacles
(`obstacle_motion`). It uses Drake's geometry queries, but no systems.
"""

"""The arithmetic of the safety filter: where a robot that brakes comes to rest, and what it may touch there.

It knows the robot, its motion and obstacles, and no systems.
"""

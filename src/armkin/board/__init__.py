"""Trajectory -> motors that turn.

ports.py   serial ports, and the lock that keeps two programs from one arm
firmware/  our own firmware's protocol, sessions, configuration, motion
sim/       a board inside the process that speaks the same bytes
"""

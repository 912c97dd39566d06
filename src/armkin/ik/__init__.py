"""Inverse kinematics: every real branch."""

"""The shape of an arm for pictures: lines and points from its axes.

skeleton.py  rigid bodies that do not depend on the pose, and a pose's lines and points
"""

"""What a solution is at a singular posture: docs/solution.md.

local_structure.py  the residual along the direction that a posture loses, and the component that it lies on
"""

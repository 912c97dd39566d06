"""Pictures (extra ``armkin[plot]``): the arm in one or many poses, and the cloud of its workspace.

canvas.py  matplotlib: figures, axes in true proportion, files
poses.py   `plot_poses`: branches, a path, a single pose
path.py    a planned path
cloud.py   `plot_workspace`: the cloud and its projections
reach.py   a map of reach, cut twice
place.py   places for an arm, as a floor

The same input gives the same file, to the byte.
"""

from armkin.plot.cloud import plot_workspace
from armkin.plot.poses import plot_poses

__all__ = ["plot_poses", "plot_workspace"]

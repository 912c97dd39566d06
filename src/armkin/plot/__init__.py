"""Pictures (extra ``armkin[plot]``): the arm in one or many poses, and the cloud of its workspace.

canvas.py             matplotlib: figures, axes in true proportion, files
pose_picture.py       `plot_poses`: branches, a path, a single pose
path_picture.py       a planned path
workspace_picture.py  `plot_workspace`: the cloud and its projections
reach_picture.py      a map of reach, cut twice
place_picture.py      places for an arm, as a floor

The same input gives the same file, to the byte.
"""

from armkin.plot.pose_picture import plot_poses
from armkin.plot.workspace_picture import plot_workspace

__all__ = ["plot_poses", "plot_workspace"]

"""Reachable positions and orientations of an arm, and the best place for an arm.

The workspace of the tip, from samples of the joint values:

sampling.py          joint values, random or on a grid
dexterity.py         manipulability and step error of a posture
volume.py            volume or area of the workspace, with an error
cloud_file.py        the samples as a .csv, .npz or .ply file
workspace_survey.py  `workspace`: all of this in one pass with bounded memory

Reachable orientations and numbers of branches in a grid of cells:

reach_cells.py   rings of cells about the axis of joint 1, and the orientations in each cell
cell_answers.py  results of a ring of cells, from arcs of joint 1 and the last joint, or from each pose
voxels.py        cubic voxels for pictures of the cells
reach_map.py     `reach`: all rings, in chunks, on any engine

place/           the best place of an arm for targets or a path
kept_chunks.py   results of chunks, kept beside the file so that a run can be resumed
"""

from armkin.reachability.workspace_survey import Workspace, workspace

__all__ = ["Workspace", "workspace"]

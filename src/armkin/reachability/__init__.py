"""What an arm's tip can reach: samples, bounds, volume, and the cloud as a file.

sampling.py          joint values: random or a grid
dexterity.py         manipulability and step error at a pose
volume.py            volume or area, with its error
cloud_file.py        .csv, .npz, .ply
workspace_survey.py  `workspace`: all of it in one pass of bounded memory

Where, with which orientations, by how many branches:

reach_cells.py     rings of cells about joint 1's axis, and the orientations in each
cell_answers.py    what a ring is answered: by arcs of joint 1 and the last joint, or pose by pose
voxels.py          cubic voxels of the cells, for pictures
reach_map.py       `reach`: all rings, in chunks, by any engine
place_search.py    `place`: where to put an arm for given targets or a path; place_file.py: its columns
place_targets.py   what an arm reaches from a place; place_arm.py: the arm there, among what stands with the targets
place_upright.py   places of an arm whose joint 1 stands upright beside the base's axis: by the distance from it alone
best_place.py      which of the places is best: by targets, margin, distance to joint limits
place_branches.py  which branches carry a way of the tool from a place; place_path.py: its plan from the best ones
kept_chunks.py     chunks of both, answered by an engine and kept beside a file
"""

from armkin.reachability.workspace_survey import Workspace, workspace

__all__ = ["Workspace", "workspace"]

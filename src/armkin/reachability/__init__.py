"""What an arm's tip can reach: samples, bounds, volume, and the cloud as a file.

sampling.py  joint values: random or a grid
measures.py  manipulability and step error at a pose
volume.py    volume or area, with its error
cloud.py     .csv, .npz, .ply
survey.py    `workspace`: all of it in one pass of bounded memory
"""

from armkin.reachability.survey import Workspace, workspace

__all__ = ["Workspace", "workspace"]

"""The best place of an arm for targets or a path.

place_search.py         `place`: counts the targets reached from each place of a grid, and chooses
reached_targets.py      targets that an arm reaches from a place
upright_joint.py        arms with a vertical joint 1 off the base's axis: answers by the distance from that joint
arm_among_obstacles.py  the arm at a place, with obstacles
best_place.py           the choice of the best place: by targets, margin, distance to joint limits
branches_from_place.py  branches that follow a path from a place
path_from_place.py      plans from the best places
place_file.py           the places as a file of columns
"""

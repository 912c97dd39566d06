"""The moves of a path to its plan, on the branch that carries the whole way.

path.py             `armkin.path`; choose_held_value.py: of arms with a redundant joint; held_joints.py: joints held
path_request.py     what is asked for beside arm and moves, and the plan where no joint is redundant
move_walk.py        goes through the moves; move_kinds.py says what each kind does
target_postures.py  the postures of a target that the path may take
timed_run.py        a run of the tool's way as timed curves
branch_report.py    what is said of each branch
path_outline.py     where a path leads the tool, before a branch or a place of the arm is chosen
jog_line.py         the line of one axis that a held button moves the tip along
"""

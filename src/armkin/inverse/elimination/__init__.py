"""The general six-joint arm, from the chain to the branches.

method.py          the method, why it is complete, `solve`
choose_variable.py `prepare`: which eigenvalue problems an arm's poses are solved by, one after the other
passes.py          one of these over poses: their answers, and which it leaves open
closed_loop.py     the chain closed and scaled; where the loop is cut, which way it is walked
line_features.py   the numbers of a line on which rigid motions are matrices
end_joints.py      removes the two end joints, and gives them back
pencil.py          the eigenvalue problem of the middle joints
roots.py           its roots as joint values
equal_roots.py     a root that several solutions share, as all of these
polish.py          Newton and Levenberg-Marquardt on the chain
merge.py           equal answers made one, rows packed by pose
three_prismatic.py three prismatic joints: a closed form instead
"""

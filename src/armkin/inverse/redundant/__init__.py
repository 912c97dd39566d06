"""More joints than the target has numbers: the answers are curves or surfaces, told by their pieces and minima.

other_joints.py       answers of the other joints at any value of the redundant one, and at which more are asked
followed_branches.py  its branches, followed along it
boundaries.py         where along it these may end, all such places
turn_roots.py         the roots of trigonometric polynomials that these places are
samples.py            what samples of these show, and between which they change
branch_ends.py        where these end
arm_angle.py          those curves in closed form, of a shoulder, an elbow and a wrist
curve_starts.py       answers at values of a joint, of other joints without a closed form, at which curves begin
curve_points.py       points of their curves, and cubics between these
traced_curves.py      such answers joined to curves
traced_families.py    and their families
interval_pieces.py    pieces of such curves: intervals of the redundant joint
families.py           one joint more than the target asks for: intervals of the redundant joint
position_first.py     four or five joints asked for a pose: the position exact, the rotation as near as it goes
least_rotation.py     the descent to those postures
"""

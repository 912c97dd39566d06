"""The joints' ways along the tool's: all branches, linked from sample to sample, and the one that is taken.

branch_columns.py   every branch at samples of the route
joint_steps.py      steps from joint values to others, and how far the tip leaves its chord on them
linked_branches.py  every branch along the route, linked from sample to sample by a certificate
branch_chains.py    how far each carries, and the fewest runs that carry all
boundary_chains.py  what branches that meet on a boundary make of it
wrist_turn.py       past a wrist singularity, the tool turned a little or the tip aside; wrist_window.py: where
branch_path.py      the branch that is taken: joint values along the route
route_grid.py       exact at grid points, fine enough in between; solve_on_route.py: Newton's method there, and slopes
"""

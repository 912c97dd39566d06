"""What a solution is at a singular posture: docs/solution.md.

local_structure.py     the residual along the direction that a posture loses, and the component that it lies on
second_order.py        the same by its second order alone: most boundaries and isolated roots
chains.py              manifolds on which the residual grows, followed from end to end
components.py          what components of the solution set candidates lie on, as far as that is asked
groups.py              candidates of targets on an edge: which are one, isolated, a boundary or a self-motion manifold
linkages.py            self-motions of two joints about one line and of four bars, at once
high_order_roots.py    roots of high order: which candidates are one, which show that none is in reach
self_motions.py        whether joints can move while the target is kept, and what lies on one self-motion
meetings.py            postures in which self-motions meet, replaced by one of each
curves.py              one-dimensional solution sets, followed, and which postures share a circuit of one
surfaces.py            self-motions of two dimensions that two joints about one line sweep, by the curves of the others
legal_postures.py      edges of which only other postures than those listed are within limits, or hit no keep-out
near_itself.py         `near` where it solves its target itself
"""

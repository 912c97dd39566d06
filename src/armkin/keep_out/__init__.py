"""Keep-outs: the bodies of an arm, the obstacles around it, their distances, and proofs that motions hit nothing.

load_with_scene.py      `armkin.load`: reads a robot and its scene, and checks that some posture is free
bodies.py               the arm's bodies: capsules along its skeleton
shapes/                 obstacles, one file for each shape
body_pairs.py           the pairs that may collide, and their distances in a posture
clearance.py            `armkin.clearance`, and texts about hits
displacement_bounds.py  bounds of a body's displacement; motion_geometry.py: the geometry of a motion without its time
motion_proof.py         proves that a motion hits nothing, also between samples
keep_out_json.py        the fields of `armkin info`

No module here depends on boards. For an arm without keep-outs only `load_with_scene` runs.
"""

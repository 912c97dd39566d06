"""Where an arm must not go: its bodies, what stands around it, how far apart they are, and proofs of motions.

load_with_scene.py      `armkin.load`: a robot, its scene, and a check that some posture is free
bodies.py               the arm's bodies: capsules along its skeleton
shapes/                 what stands around it: one file a shape
body_pairs.py           which pairs count, and how far apart each is in a posture
clearance.py            `armkin.clearance`, and hits in words
displacement_bounds.py  how far a body moves when joints do; motion_geometry.py: a motion as its geometry alone
motion_proof.py         a motion proved free between its samples
keep_out_json.py        what `armkin info` tells

Nothing here knows boards. An arm without keep-outs comes no farther than `load_with_scene`.
"""

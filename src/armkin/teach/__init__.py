"""The page of `armkin teach`: shows an arm, chooses branches, records a program and moves the motors.

server.py            HTTP on 127.0.0.1: files, events, actions
page_key.py          access control by the key and the origin of a request
request_checks.py    checks of a request's fields
tabs.py              the open pages: which one holds control, unread messages of each
actions.py           every action by its name; program_actions.py: actions on the program
plan_samples.py      samples of a plan for playback
recorded_program.py  recorded moves with the keys of a path file
arm_description.py   links, bodies and limits for drawing
urdf_meshes.py       meshes of bodies from a URDF; mesh_files.py: triangles of STL and Collada files
pose_answers.py      one pose or one target: branches, limits, pulses
quick_ik.py          machine code for an arm that Python solves slowly
board_actions.py     the actions on the board; board_thread.py: the thread that owns the port
one_file.py          the page without a server, in one HTML file; local/: its replacement of the server
reach_slice.py       the reach in the plane of the links
browser_solver.py    the arm's solver as JavaScript for the browser
static/              the page itself; static/vendor/three is three.js, byte for byte
"""

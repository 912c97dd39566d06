"""A page for an arm: see it, choose the branch, write a program, move the motors.

server.py            HTTP on 127.0.0.1: files, events, actions
page_key.py          who may ask: the key and the origin of a request
request_checks.py    whether a request's fields are what they must be
tabs.py              the open pages: which one holds control, what each has still to hear
actions.py           every action by its name; program_actions.py: those on the program
plan_samples.py      a plan as the page plays it, by error
recorded_program.py  moves recorded one after another, in the words of a path file
arm_description.py   what the page draws: links, bodies, limits
urdf_meshes.py       what the bodies look like, from a URDF; mesh_files.py: triangles of STL and Collada files
pose_answers.py      one pose or one target: branches, limits, pulses
quick_ik.py          machine code for an arm whose answers take long
board_actions.py     the actions on the board; board_thread.py: the thread that owns the port
one_file.py          the page without a server, in one HTML file; local/: what answers in the server's place
reach_slice.py       where it reaches in the plane of its links, for the page
browser_solver.py    the arm's solver for the browser itself
static/              the page itself; static/vendor/three is three.js, byte for byte
"""

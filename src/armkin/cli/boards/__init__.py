"""What commands with a board share.

default_port.py    the port that a command means
board_link.py      an open machine, signals
link_trace.py      a log of its bytes
send_goals.py      all kinds of goals of `send`
carry_out_path.py  a path, planned and carried out, for `path` and `send --path`
keep_outs.py       assumed radii, the scene of a port, ignored hits
"""

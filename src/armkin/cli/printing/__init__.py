"""Where data and messages go, and answers as JSON and as text.

output.py        destinations of data and messages
progress_bar.py  progress of a long command, with rate and time left
render.py        JSON and aligned columns
ik_answer.py     ik's JSON; ik_text.py: as text
info_text.py     what `info` says
path_text.py     what `path` says
"""

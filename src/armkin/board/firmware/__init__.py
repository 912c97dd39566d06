"""The boards that run armkin's own firmware (firmware/PROTOCOL.md).

framing.py              payloads to bytes on the line and back
protocol.py             payloads
motion_frame.py         the payload of a motion; segment.py: one segment and its bytes
configuration_image.py  the configuration image
session.py              opened, spoken in, held; window.py: go-back-N with credit; serial_line.py: noise on the line
reply_checks.py         what a board may say
configuration.py        a robot file as its board must know it; missing_keys.py: what it lacks
cutting.py              a trajectory as moves; straight_lines.py and curves.py: as segments, which segments.py makes
machine.py              an arm on its board
homing.py               homing by limit switches
"""

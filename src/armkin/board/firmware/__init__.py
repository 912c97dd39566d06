"""The boards that run armkin's own firmware (firmware/PROTOCOL.md).

framing.py        payloads to bytes on the line and back
protocol.py       payloads
image.py          the configuration image
session.py        go-back-N with credit over any port
configuration.py  a robot file as its board must know it
segments.py       straight lines in counts as device segments
machine.py        an arm on its board
homing.py         homing by limit switches
"""

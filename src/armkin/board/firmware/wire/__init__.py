"""Bytes, frames and the conversation with a board that runs armkin's firmware (firmware/PROTOCOL.md).

framing.py              payloads to bytes on the line and back
protocol.py             payloads
segment_format.py       one segment and its bytes; motion_frame.py: those of the payload that carries several
configuration_image.py  the configuration image
reply_checks.py         what a board may say
find_boards.py          which plugged-in boards answer
session.py              opened, spoken in, held
go_back_n.py            frames in sequence, sent again until they are acknowledged; serial_line.py: noise on the line
"""

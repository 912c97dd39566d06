"""What other programs say on a board's port, or noise, by the board's kind."""

from __future__ import annotations

from armkin.board.firmware.wire import protocol
from armkin.board.firmware.wire.framing import encode_frame

OURS = (  # a second program that speaks our protocol, one that takes the board for another, noise
    encode_frame(protocol.hello(1, 77)),
    encode_frame(protocol.hello(1, 78))
    + encode_frame(protocol.set_position(2, {0: 5000}))
    + encode_frame(protocol.jog(3, (100,))),
    *(b"G1 X5 F500\n", b"\x00\x01\x02\x00" * 8, bytes(range(256)), b"\x00"),
)
GRBL = (
    *(b"G92 X0 Y0 Z0\n", b"G10 L20 P1 X0\n", b"G10 L2 P1 X10 Y10\n", b"G55\n", b"G43.1 Z7\n", b"G92 X7\nG92.1\n"),
    *(b"G20G91\n", b"G91G1X3F900\n", b"G93\n", b"\x18", b"!", b"G1X5", b"(half a comment", b"\x91\x91", b"$X\n"),
)

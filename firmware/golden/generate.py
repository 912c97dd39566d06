"""Writes the golden vectors from PROTOCOL.md: ``python3 generate.py`` in this folder.

Standalone on purpose: it shares no code with the firmware or with armkin, so that it can accuse both.
"""

import struct
import zlib
from pathlib import Path

import messages
from messages import (
    STEP,
    Segment,
    ack,
    back,
    commit,
    config,
    enable,
    grip,
    hello,
    hold,
    home,
    image,
    info,
    jog,
    mask,
    motion,
    ramp,
    report,
    set_position,
    status,
    steps_of,
    units,
    vector,
    whole,
    wire,
)

HERE = Path(__file__).parent


def frames() -> str:
    img = image()
    lines: list[tuple[str, bytes]] = []

    def add(text: str, payload: bytes) -> None:
        lines.append((text, payload))

    def add_motion(tag: int, which: int, flags: int, start: list[int], segments: list[Segment]) -> None:
        end = [a + b for a, b in zip(start, steps_of(segments), strict=True)]
        text = ";".join(f"{t}/{i}/{a}/" + ",".join(map(str, s)) for t, i, a, s in segments)
        commas = (",".join(map(str, v)) for v in (start, end))
        add(
            f"MOTION tag={tag} mask={which} flags={flags} start={next(commas)} end={next(commas)} segments={text}",
            motion(tag, which, flags, start, end, segments),
        )

    add("HELLO tag=5 version=2 nonce=3735928559", hello(5, 3735928559))
    add("HELLO tag=0 version=2 nonce=0", hello(0, 0))
    add("STATUS? tag=7 page=0", status(7))
    add("STATUS? tag=255 page=1", status(255, 1))
    add("HOLD tag=9", hold(9))
    add(f"CONFIG tag=0 offset=0 data={img.hex()}", config(0, 0, img))
    add(f"COMMIT tag=1 length={len(img)} crc={zlib.crc32(img)}", commit(1, img))
    add("ENABLE tag=2 what=3", enable(2, 3))
    add("SET_POSITION tag=3 mask=23 counts=0,-1,70000,1500", set_position(3, 23, [0, -1, 70000, 1500]))
    add_motion(4, 7, 1, [0, 0, 0], ramp())
    add_motion(5, 7, 3, [-40, -217, 122], back())
    add_motion(6, 16, 3, [1500], grip())
    add_motion(7, 7, 13, [0, 0, 0], ramp())
    add_motion(255, 1, 0, [-128], [whole(255, 400, -1, [127]), whole(255, 65535, 1, [-128])])
    add(
        "HOME tag=7 switch=2 flags=1 slow=26 backoff=200 travel=100000 time=300 rate=0,-4000,0,0,0",
        home(7, 2, 1, 26, 200, 100000, 300, [0, -4000, 0, 0, 0]),
    )
    add("JOG tag=8 rate=100,0,-100,0,0", jog(8, [100, 0, -100, 0, 0]))
    add("ACK next=6 error=0 detail=0 state=1 free=28 queued=313 session=0", ack(6, 0, 0, 1, 28, 313))
    add("ACK next=6 error=17 detail=2 state=2 free=0 queued=65535 session=0", ack(6, 17, 2, 2, 0, 65535))
    add(
        "INFO tag=5 version=2 firmware=2,0 nonce=3735928559 board=1 axes=5 servos=16 switches=3 rows=5 "
        "queue=32 frame=160 receive=127 min_interval=400 clock=16000000 config=305441741 known=23 flags=5 "
        "boots=3 cause=2",
        struct.pack("<5BIBBHBBBB", 0x81, 5, 2, 2, 0, 3735928559, 1, 5, 16, 3, 5, 32, 160)
        + struct.pack("<HHIIHBHB", 127, 400, 16_000_000, 305441741, 23, 5, 3, 2),
    )
    add(
        "STATUS tag=7 next=6 error=0 detail=0 state=1 flags=7 free=28 queued=313 known=23 switches=7 "
        "overruns=0 bad=1 page=0 session=48879 counts=-40,-317,212,0,1500 late_servos=3",
        struct.pack("<8BHH4BH5iB", 0x82, 7, 6, 0, 0, 1, 7, 28, 313, 23, 7, 0, 1, 0, 48879, -40, -317, 212, 0, 1500, 3),
    )
    head = "# NAME field=value ... | payload | wire, written by generate.py from PROTOCOL.md\n"
    return head + "".join(f"{text} | {p.hex()} | {wire(p).hex()}\n" for text, p in lines)


class Talk:
    """Collects the lines of a conversation; `tag` counts the sequence."""

    def __init__(self, title: str, name: str) -> None:
        messages.board = messages.BOARDS[name]
        self.opened(None)
        self.lines = [f"# {title}; written by generate.py from PROTOCOL.md", f"board {name}"]

    def note(self, text: str) -> None:
        self.lines.append(f"# {text}")

    def opened(self, nonce: int | None) -> None:
        """From here on the replies are those of another session, or of none."""
        messages.digest = 0 if nonce is None else nonce & 0xFFFF

    def raw(self, text: str) -> None:
        self.lines.append(text)
        if text == "reset":
            self.opened(None)

    def say(self, payload: bytes, answer: bytes | str) -> None:
        if payload[0] == 1 and payload[2] == 2:
            self.opened(struct.unpack_from("<I", payload, 3)[0])
        self.lines += [f"> {payload.hex()}", f"< {answer if isinstance(answer, str) else answer.hex()}"]

    def setup(self, nonce: int, what: int = 3) -> int:
        """Opens a session on a board with no memory, configures it, declares its position; the next sequence number."""
        img = image()
        self.say(hello(1, nonce), info(1, nonce, 0, 0, 0))
        self.say(config(0, 0, img[:100]), ack(1))
        self.say(config(1, 100, img[100:]), ack(2))
        self.say(commit(2, img), ack(3))
        self.say(set_position(3, mask(0, 1, 2, -1), [0, 0, 0, 1500]), ack(4))
        self.say(enable(4, what), ack(5))
        return 5

    def write(self, name: str) -> None:
        (HERE / name).write_text("\n".join(self.lines) + "\n")


def talks(name: str, suffix: str = "") -> None:
    """The conversations with a board that has steppers."""

    t = Talk("HELLO, configuration, position, three moves, a reset at rest", name)
    t.setup(0xDEADBEEF)
    crc = zlib.crc32(image())
    known, everything = mask(0, 1, 2), mask(0, 1, 2, -1)
    end = steps_of(ramp())
    t.say(motion(5, 7, 1, [0, 0, 0], end, ramp()), ack(6, 0, 0, 1, messages.board.queue - 3, units(ramp())))
    t.raw("wait 400")
    t.say(status(7), report(7, 6, 0, 0, 0, 7, everything, vector(*end, 1500)))
    t.note("wide segments, back home; then the gripper: an axis like the others")
    t.say(motion(6, 7, 15, end, [0, 0, 0], back()), ack(7, 0, 0, 1, messages.board.queue - 1, units(back())))
    t.raw("wait 300")
    t.say(motion(7, mask(-1), 3, [1500], [1590], grip()), ack(8, 0, 0, 1, messages.board.queue - 1, units(grip())))
    t.raw("wait 450")
    t.say(status(8), report(8, 8, 0, 0, 0, 7, everything, vector(0, 0, 0, 1590)))
    t.note("a repeated HELLO changes nothing, a duplicate moves nothing")
    t.say(hello(9, 0xDEADBEEF), info(9, 0xDEADBEEF, crc, everything, 7))
    t.say(motion(7, mask(-1), 3, [1500], [1590], grip()), ack(8))
    t.say(status(9), report(9, 8, 0, 0, 0, 7, everything, vector(0, 0, 0, 1590)))
    t.note("steppers and image survive a reset at rest, drivers come back on; servo pulses do not, so servos are lost")
    t.raw("reset")
    t.say(status(10), report(10, 0, 1, 0, 0, 0b1101, known, vector(0, 0, 0, 1590)))
    t.say(hello(11, 77), info(11, 77, crc, known, 0b1101))
    t.say(set_position(0, 1, [0]), ack(0, 10))
    t.write(f"move{suffix}.talk")

    t = Talk("Every refusal ends the session and moves nothing", name)
    t.say(status(1), report(1, 0, 1, 0, 0, 0, 0, vector(0, 0, 0)))
    t.say(enable(0, 1), ack(0, 1))
    t.say(hello(2, 5, version=9), info(2, 5, 0, 0, 0))
    t.say(enable(0, 1), ack(0, 1))
    t.say(hello(1, 99), info(1, 99, 0, 0, 0))
    t.say(hello(2, 5, version=9), info(2, 5, 0, 0, 0))
    t.say(enable(0, 1), ack(0, 2))
    t.say(hello(1, 100), info(1, 100, 0, 0, 0))
    t.say(b"\x18\x00", ack(0, 3))
    t.note("the session is over: the same HELLO does not open it again, a new one does")
    t.say(enable(0, 1), ack(0, 3))
    t.say(hello(1, 100), info(1, 100, 0, 0, 0))
    t.say(enable(0, 1), ack(0, 3))
    t.say(hello(1, 99), info(1, 99, 0, 0, 0))
    t.say(motion(0, 1, 1, [0], [1], [whole(20, 16000, 0, [1])]), ack(0, 6))
    t.setup(101, what=0b11)
    t.note("a gap is not executed")
    t.say(motion(6, 1, 1, [0], [1], [whole(20, 16000, 0, [1])]), ack(5))
    known, at_home = mask(0, 1, 2, -1), vector(0, 0, 0, 1500)
    slow = (100, 16000, 0)
    for nonce, payload, error, detail in (
        (1000, b"\x17\x00", 3, 0),
        (1001, motion(0, 1, 1, [0], [5], [whole(*slow, [5])]) + b"\0", 4, 0),
        (1002, motion(0, 1, 1, [0], [5], [whole(*slow, [5])])[:-1], 4, 0),
        (1003, motion(0, 1, 32, [0], [5], [whole(*slow, [5])]), 4, 0),
        (1004, struct.pack("<BBHBBii", 0x14, 0, 1, 1, 0, 0, 0), 4, 0),
        (1005, motion(0, 8, 1, [0], [5], [whole(*slow, [5])]), 5, 3),
        (1006, motion(0, 32, 1, [0], [5], [whole(*slow, [5])]), 5, 5),
        (1007, motion(0, 3, 1, [0, 7], [5, 12], [whole(*slow, [5, 5])]), 12, 1),
        (1008, motion(0, 3, 1, [0, 0], [5, 6], [whole(*slow, [5, 5])]), 13, 1),
        (1009, motion(0, 1, 1, [0], [5], [whole(*slow, [4]), whole(100, 63, 0, [1])]), 14, 1),
        (1010, motion(0, 1, 1, [0], [5], [whole(100, 65000, 2000, [5])]), 14, 0),
        (1011, motion(0, 3, 1, [0, 0], [5, 6], [(5, 16000, 0, [0, -STEP])]), 15, 1),
        (1012, motion(0, 1, 1, [0], [100], [whole(100, 4000, 0, [100])]), 16, 0),
        (1014, motion(0, 1, 1, [0], [100], [whole(200, 8000, 0, [100])]), 29, 0),
        # what changes within a segment leaves less for the jump to it
        (1023, motion(0, 1, 1, [0], [130], [whole(100, 8000, 0, [25]), whole(135, 6914, -5011, [105])]), 29, 0),
        (
            1013,
            motion(0, mask(0, -1), 3, [0, 1500], [0, 2101], [whole(2600, 16000, 0, [0, 601], 1)]),
            17,
            messages.board.gripper,
        ),
        (1015, set_position(0, 3, [0, 0]), 10, 0),
        (1016, set_position(0, 8, [0]), 5, 3),
        (1017, jog(0, vector(0, 8001, 0)), 16, 1),
        (1018, jog(0, [*vector(0, 0, 0)[:3], 1, *vector(0, 0, 0)[4:]]), 5, 3),
        (1019, home(0, 9, 0, 26, 100, 1000, 10, vector(100, 0, 0)), 5, 0),
        (1020, home(0, 0, 0, 26, 100, 1000, 10, vector(0, 0, 0)), 5, 0),
        (1021, home(0, 0, 0, 26, 100, 1000, 10, vector(0, 0, 0, 10)), 5, messages.board.gripper),
        (1022, hold(0), 21, 0),
    ):
        t.say(hello(1, nonce), info(1, nonce, crc, known, 0b111))
        t.say(payload, ack(0, error, detail))
    t.note("nothing has moved")
    t.say(status(2), report(2, 0, 21, 0, 0, 7, known, at_home))
    t.note("drivers off: steppers are lost; pulses off: servos too")
    t.say(hello(1, 2000), info(1, 2000, crc, known, 0b111))
    t.say(enable(0, 2), ack(1))
    t.say(
        motion(1, mask(-1), 1, [1500], [1510], [whole(*slow, [10])]),
        ack(2, 0, 0, 1, messages.board.queue - 1, units([whole(*slow, [10])])),
    )
    t.raw("wait 150")
    t.say(motion(2, 1, 1, [0], [5], [whole(*slow, [5])]), ack(2, 9, 0))
    t.say(hello(1, 2001), info(1, 2001, crc, mask(-1), 0b110))
    t.say(set_position(0, 7, [0, 0, 0]), ack(1))
    t.say(motion(1, 1, 1, [0], [5], [whole(*slow, [5])]), ack(1, 11, 0))
    t.note("a broken image is not taken, and what was known is lost")
    bad = bytearray(image())
    bad[12 + 21 + 13 : 12 + 21 + 17] = bytes(4)
    t.say(hello(1, 2002), info(1, 2002, crc, known, 0b110))
    t.say(config(0, 0, bytes(bad)), ack(1))
    t.say(commit(1, bytes(bad)), ack(1, 7))
    t.say(status(3), report(3, 1, 7, 0, 0, 0, 0, vector(0, 0, 0, 1510)))
    t.note("max_rate may be more than a rate can be: one whose way back is no rate is refused")
    fast = image()[: 12 + 21 + 13] + b"\xff" * 4 + image()[12 + 21 + 17 :]
    t.say(hello(1, 2003), info(1, 2003, 0, 0, 0))
    t.say(config(0, 0, fast[:100]), ack(1))
    t.say(config(1, 100, fast[100:]), ack(2))
    t.say(commit(2, fast), ack(3))
    t.say(set_position(3, 2, [0]), ack(4))
    t.say(enable(4, 1), ack(5))
    t.say(home(5, 0, 0, 26, 100, 1000, 10, vector(0, -(1 << 31), 0)), ack(5, 16, 1))
    t.say(hello(1, 2004), info(1, 2004, zlib.crc32(fast), 2, 0b101))
    t.say(jog(0, vector(0, -(1 << 31), 0)), ack(0, 16, 1))
    t.write(f"refuse{suffix}.talk")

    t = Talk("A joint limit of coupled motors: Y and Z turn one joint by their sum", name)
    img = image(rows=[(-1000, 1000, vector(0, 2, 2))])
    t.say(hello(1, 9), info(1, 9, 0, 0, 0))
    t.say(config(0, 0, img[:100]), ack(1))
    t.say(config(1, 100, img[100:]), ack(2))
    t.say(commit(2, img), ack(3))
    t.say(set_position(3, 7, [0, 0, 0]), ack(4))
    t.say(enable(4, 1), ack(5))
    pair = [whole(300, 16000, 0, [300, -200], 1), whole(100, 16000, 0, [0, 0], 1)]
    t.say(motion(5, 6, 3, [0, 0], [300, -200], pair), ack(6, 0, 0, 1, messages.board.queue - 2, units(pair)))
    t.raw("wait 450")
    t.say(motion(6, 6, 3, [300, -200], [701, -200], [whole(401, 16000, 0, [401, 0], 1)]), ack(6, 18))
    t.write(f"joint_limit{suffix}.talk")

    t = Talk("Damaged bytes are dropped without an answer, and counted", name)
    t.say(hello(1, 3), info(1, 3, 0, 0, 0))
    sound = wire(status(2))
    broken = bytearray(sound)
    broken[2] ^= 0x10
    for data in (bytes(broken), sound[:-3] + b"\0", b"\x05\x01\0", bytes([1] * 200) + b"\0"):
        t.raw(f"wire {data.hex()}")
        t.raw("silent")
    t.note("empty frames are ignored, a question after them is answered")
    t.raw("wire 000000" + sound.hex())
    t.raw("< " + report(2, 0, 0, 0, 0, 0, 0, vector(0, 0, 0), bad="04"))
    t.note("an unknown type outside of the sequence gets no answer, nor does a HELLO of the wrong length")
    t.raw("wire " + wire(b"\x0f\x01").hex())
    t.raw("wire " + wire(hello(1, 4) + b"\0").hex())
    t.raw("wire " + wire(b"\x80\x01").hex())
    t.raw("silent")
    t.write(f"noise{suffix}.talk")


def servo_talk() -> None:
    """Two joints of a servo arm: the count is the pulse width."""
    crc_of = zlib.crc32
    img = struct.pack("<8BI", 2, 6, 0, 0, 0, 0, 0, 0, 7)
    img += struct.pack("<BiiiII", 1, 500, 2500, 1500, 1000, 4000) * 2
    img += struct.pack("<BiiiII", 0, 0, 0, 0, 0, 0) * 4
    t = Talk("Servos: a start pose and consent before the first pulse, then motion like any other", "uno_servos")
    t.say(hello(1, 1), info(1, 1, 0, 0, 0))
    t.say(config(0, 0, img[:90]), ack(1))
    t.say(config(1, 90, img[90:]), ack(2))
    t.say(commit(2, img), ack(3))
    t.note("nobody has said where the servos stand, then nobody has consented to pulses")
    move = [whole(200, 16000, 0, [40, -40], 1), whole(100, 16000, 0, [0, -20], 1)]
    t.say(motion(3, 3, 3, [1500, 1500], [1540, 1440], move), ack(3, 9, 0))
    t.say(hello(1, 2), info(1, 2, crc_of(img), 0, 4))
    t.say(set_position(0, 3, [1500, 2501]), ack(0, 5, 1))
    t.say(hello(1, 3), info(1, 3, crc_of(img), 0, 4))
    t.say(set_position(0, 3, [1500, 1500]), ack(1))
    t.say(motion(1, 3, 3, [1500, 1500], [1540, 1440], move), ack(1, 11, 0))
    t.say(hello(1, 4), info(1, 4, crc_of(img), 3, 4))
    t.say(enable(0, 2), ack(1))
    t.say(motion(1, 3, 3, [1500, 1500], [1540, 1440], move), ack(2, 0, 0, 1, 30, units(move)))
    t.raw("wait 400")
    t.say(status(5), report(5, 2, 0, 0, 0, 6, 3, [1540, 1440, 0, 0, 0, 0]))
    t.note("beyond the pulse that the joint may have")
    t.say(motion(2, 3, 3, [1540, 1440], [2501, 1440], [whole(5000, 16000, 0, [961, 0], 1)]), ack(2, 17, 0))
    t.note("after a reset the servos are lost: nothing held them")
    t.raw("reset")
    t.say(hello(1, 5), info(1, 5, crc_of(img), 0, 0b100))
    tiny = [whole(100, 16000, 0, [10, 0], 1)]
    t.say(motion(0, 3, 3, [1540, 1440], [1550, 1440], tiny), ack(0, 9, 0))
    t.say(hello(1, 6), info(1, 6, crc_of(img), 0, 0b100))
    t.say(set_position(0, 3, [1540, 1440]), ack(1))
    t.say(enable(1, 2), ack(2))
    t.say(motion(2, 3, 3, [1540, 1440], [1550, 1440], tiny), ack(3, 0, 0, 1, 31, units(tiny)))
    t.raw("wait 150")
    t.say(status(6), report(6, 3, 0, 0, 0, 0b110, 3, [1550, 1440, 0, 0, 0, 0]))
    t.note("pulses off: the servos may go anywhere, so they are lost")
    t.say(enable(3, 0), ack(4))
    t.say(status(7), report(7, 4, 0, 0, 0, 4, 0, [1550, 1440, 0, 0, 0, 0]))
    t.write("servos.talk")


def main() -> None:
    """Write all files."""
    (HERE / "frames.txt").write_text(frames())
    talks("uno_cnc_shield")
    talks("pico6", "_pico6")
    servo_talk()


if __name__ == "__main__":
    main()

"""Frames and bytes: the golden vectors, and what noise may and may not do."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from armkin.board.firmware.wire import motion_frame, protocol

PACK: dict[type, Callable[..., bytes]] = {
    protocol.Ack: protocol.pack_ack,
    protocol.Credit: protocol.pack_ack,
    protocol.Info: protocol.pack_info,
    protocol.Status: protocol.pack_status,
}
GOLDEN = Path(__file__).parents[2] / "firmware" / "golden"


def golden_frames() -> list[tuple[str, dict[str, str], bytes, bytes]]:
    lines = (GOLDEN / "frames.txt").read_text().splitlines()
    frames = []
    for line in lines:
        if line.startswith("#"):
            continue
        text, payload, wire = (part.strip() for part in line.split("|"))
        name, *fields = text.split()
        pairs = dict(field.split("=", 1) for field in fields)
        frames.append((name, pairs, bytes.fromhex(payload), bytes.fromhex(wire)))
    return frames


def parse_integers(text: str) -> tuple[int, ...]:
    return tuple(int(x) for x in text.split(","))


def axes_of(mask: str) -> list[int]:
    return [i for i in range(16) if int(mask) >> i & 1]


def build_payload(name: str, field: dict[str, str]) -> bytes:
    """The payload of a golden line, built by the code under test."""
    tag = int(field.get("tag", 0))
    if name == "HELLO":
        return protocol.hello(tag, int(field["nonce"]), int(field["version"]))
    if name == "STATUS?":
        return protocol.status_query(tag, int(field["page"]))
    if name == "HOLD":
        return protocol.hold(tag)
    if name == "CONFIG":
        return protocol.config(tag, int(field["offset"]), bytes.fromhex(field["data"]))
    if name == "COMMIT":
        return protocol.commit(tag, int(field["length"]), int(field["crc"]))
    if name == "ENABLE":
        return protocol.enable(tag, int(field["what"]))
    if name == "SET_POSITION":
        return protocol.set_position(
            tag, dict(zip(axes_of(field["mask"]), parse_integers(field["counts"]), strict=True))
        )
    if name == "MOTION":
        segments = []
        for text in field["segments"].split(";"):
            ticks, interval, add, steps = text.split("/")
            segments.append(protocol.Segment(int(ticks), int(interval), 256 * int(add), parse_integers(steps)))
        flags = int(field["flags"])
        return motion_frame.motion(
            tag,
            axes_of(field["mask"]),
            parse_integers(field["start"]),
            parse_integers(field["end"]),
            segments,
            at_rest=bool(flags & 1),
            wide=bool(flags & 2),
            brake=1 - (flags >> 2) / 8,
        )
    if name == "HOME":
        return protocol.home(
            tag,
            switch=int(field["switch"]),
            closed=field["flags"] == "1",
            slow=int(field["slow"]),
            backoff=int(field["backoff"]),
            travel=int(field["travel"]),
            time=int(field["time"]),
            rate=parse_integers(field["rate"]),
        )
    if name == "JOG":
        return protocol.jog(tag, parse_integers(field["rate"]))
    if name in ("ACK", "CREDIT"):
        fields = (int(field[k]) for k in ("next", "error", "detail", "state", "free", "queued", "session"))
        return protocol.pack_ack((protocol.Ack if name == "ACK" else protocol.Credit)(*fields))
    if name == "INFO":
        values = {k: int(v) for k, v in field.items() if k != "firmware"}
        major, minor = parse_integers(field["firmware"])
        return protocol.pack_info(protocol.Info(**values, firmware=(major, minor)))
    assert name == "STATUS"
    values = {k: int(v) for k, v in field.items() if k != "counts"}
    return protocol.pack_status(protocol.Status(**values, counts=parse_integers(field["counts"])))


@pytest.mark.parametrize(
    ("name", "fields", "payload", "wire"), golden_frames(), ids=lambda v: v if isinstance(v, str) else ""
)
def test_golden_frames(name: str, fields: dict[str, str], payload: bytes, wire: bytes) -> None:
    assert build_payload(name, fields) == payload
    assert protocol.encode_frame(payload) == wire
    assert list(protocol.Splitter().feed(wire)) == [payload]
    reply = protocol.parse_reply(payload)
    if payload[0] >= 0x80:
        assert reply is not None
        assert PACK[type(reply)](reply) == payload
    else:
        assert reply is None


def test_the_golden_file_has_every_frame() -> None:
    types = {payload[0] for _, _, payload, _ in golden_frames()}
    assert types | {protocol.Type.CREDIT} == {int(t) for t in protocol.Type}


def test_credit_is_an_ack_that_reports_no_gap() -> None:
    ack = bytes.fromhex("830600 00011c3901adde".replace(" ", ""))
    credit = protocol.parse_reply(ack)
    assert credit == protocol.Credit(6, 0, 0, 1, 28, 313, 0xDEAD)
    assert isinstance(credit, protocol.Credit)
    assert protocol.pack_ack(credit) == ack


def test_error_codes_are_those_of_the_text() -> None:
    text = (GOLDEN.parent / "PROTOCOL.md").read_text()
    rows = re.findall(r"^\| (\d+) \| ([A-Z_]+) \|", text[text.index("## 11.") :], re.MULTILINE)
    assert {int(code): name for code, name in rows} == {e.value: e.name for e in protocol.Error if e}


@given(st.binary(max_size=250))
def test_cobs_round_trip(data: bytes) -> None:
    coded = protocol.cobs_encode(data)
    assert 0 not in coded
    assert len(coded) == len(data) + 1
    assert protocol.cobs_decode(coded) == data


@given(st.binary(max_size=260))
def test_cobs_decode_takes_nothing_that_encode_does_not_make(data: bytes) -> None:
    decoded = protocol.cobs_decode(data)
    if decoded is not None and len(decoded) <= 254:
        assert protocol.cobs_encode(decoded) == data


@given(st.lists(st.binary(min_size=2, max_size=246), max_size=5), st.data())
def test_a_stream_in_pieces_gives_its_payloads(payloads: list[bytes], data: st.DataObject) -> None:
    stream = b"\0".join([b"", *(protocol.encode_frame(p) for p in payloads)])
    splitter = protocol.Splitter()
    received: list[bytes] = []
    while stream:
        n = data.draw(st.integers(1, len(stream)))
        received += splitter.feed(stream[:n])
        stream = stream[n:]
    assert received == payloads
    assert splitter.bad == 0


def test_random_bytes_are_never_a_frame() -> None:
    rng = random.Random(4)
    splitter = protocol.Splitter()
    noise = rng.randbytes(1_000_000)
    assert list(splitter.feed(noise)) == []
    assert splitter.bad > 1000


def test_a_damaged_stream_yields_only_what_was_sent() -> None:
    rng = random.Random(5)
    sent = [payload for _, _, payload, _ in golden_frames()] * 500
    stream = b"".join(protocol.encode_frame(p) for p in sent)
    damaged = bytearray()
    for byte in stream:
        if rng.random() < 0.01:
            byte ^= 1 << rng.randrange(8)
        if rng.random() >= 0.01:
            damaged.append(byte)
    received = list(protocol.Splitter().feed(bytes(damaged)))
    assert 0.1 < len(received) / len(sent) < 0.9
    assert set(received) <= set(sent)


def test_a_long_frame_is_skipped_to_its_end() -> None:
    good = protocol.encode_frame(protocol.hold(1))
    splitter = protocol.Splitter(largest=20)
    assert list(splitter.feed(b"\x01" * 30)) == []
    assert list(splitter.feed(b"\x01" * 30 + b"\0" + good)) == [protocol.hold(1)]
    assert splitter.bad == 1


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="247 bytes"):
        protocol.encode_frame(bytes(247))
    with pytest.raises(ValueError, match="255 bytes"):
        protocol.cobs_encode(bytes(255))


@given(
    st.lists(
        st.builds(
            protocol.AxisImage,
            st.booleans(),
            st.booleans(),
            *[st.integers(-(2**30), 2**30)] * 3,
            st.integers(0, 2**32 - 1),
            st.integers(0, 2**24),
        ),
        max_size=9,
    ),
    st.data(),
)
def test_image_round_trip(axes: list[protocol.AxisImage], data: st.DataObject) -> None:
    weight = st.tuples(*[st.integers(-32768, 32767)] * len(axes))
    row = st.builds(protocol.RowImage, st.integers(-9, 0), st.integers(0, 9), weight)
    rows = data.draw(st.lists(row, max_size=3))
    bare = protocol.GuardImage(weight=(0,) * len(axes))
    guards = (bare, protocol.GuardImage(True, (-127, *(0,) * (len(axes) - 1))) if axes else bare)
    image = protocol.Image(tuple(axes), tuple(rows), guards, abort_closed=True, power_sensed=True, meaning=2**32 - 1)
    packed = image.pack()
    assert protocol.Image.unpack(packed, 2) == image
    assert protocol.Image.unpack(packed + b"\0", 2) is None
    assert protocol.Image.unpack(packed[:-1], 2) is None


def test_golden_image() -> None:
    data = next(f["data"] for name, f, _, _ in golden_frames() if name == "CONFIG")
    image = protocol.Image.unpack(bytes.fromhex(data), 3)
    assert image is not None
    assert image.axes[2] == protocol.AxisImage(True, True, -2000, 14000, 0, 6000, 18000)
    assert not image.axes[3].used
    assert image.pack().hex() == data


@pytest.mark.parametrize(
    "payload", [b"\x80\0", b"\x81" + bytes(33), b"\x82" + bytes(18), b"\x83" + bytes(10), b"\x00\x00"]
)
def test_replies_of_the_wrong_shape_are_none(payload: bytes) -> None:
    assert protocol.parse_reply(payload) is None


def test_the_version_of_another_protocol_can_be_read() -> None:
    assert protocol.info_version(bytes([0x81, 7, 9]) + bytes(40)) == 9
    assert protocol.info_version(bytes([0x80, 7, 9])) is None

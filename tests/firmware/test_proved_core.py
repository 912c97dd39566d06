"""What is proved of the core: Frama-C's EVA on a segment, a line and a frame of any bytes, and a count beside it."""

from __future__ import annotations

import re
import subprocess

from emulator import FIRMWARE

# The lines that EVA leaves open, each discharged by test/proof/count.c, which takes every number of ticks through them.
COUNTED = {
    "return (product(s->bend, bends >> 8) + (product(s->bend, bends & 0xFF) >> 8)) >> 9;",
    "memcpy((uint8_t *)&memory.image + offset, data, length);",
}


def test_no_bytes_of_a_segment_overflow_or_read_beside_it() -> None:
    command = ["make", "-s", "-C", str(FIRMWARE), "proof", "BOARD=uno_cnc_shield"]
    completed = subprocess.run(command, capture_output=True, text=True, check=False)
    assert completed.returncode == 0, completed.stdout[-2000:] + completed.stderr
    assert "100% of the logical properties reached have been proven" in completed.stdout
    assert re.search(r"^\d{6,} calls, no overflow$", completed.stdout, re.M)
    alarms = re.findall(r"\[eva:alarm\] (\S+):(\d+): Warning: *\n? *(.*)", completed.stdout)
    lines = {(FIRMWARE / name).read_text().splitlines()[int(line) - 1].strip() for name, line, _ in alarms}
    assert lines == COUNTED
    assert all("signed overflow" in alarm or "valid_dest" in alarm for *_, alarm in alarms)

"""From the linked program to what a Pico is flashed with: image.py PROGRAM.bin OUT.uf2

Puts the checksum into the boot block, and writes the UF2 file that a Pico in BOOTSEL mode takes.
UF2: https://github.com/microsoft/uf2 (blocks of 512 bytes); the checksum: RP2040 datasheet, 2.8.1.3.1.
"""

from __future__ import annotations

import struct
import sys
from pathlib import Path

FLASH = 0x1000_0000
BLOCK = 256  # bytes of payload
FAMILY_RP2040 = 0xE48B_FF56
_START0, _START1, _END = 0x0A32_4655, 0x9E5D_5157, 0x0AB1_6F30
_HAS_FAMILY = 0x2000


def boot_checksum(data: bytes) -> int:
    """CRC-32 as the boot ROM has it: polynomial 04C11DB7, from FFFFFFFF, not reflected, not inverted.

    >>> hex(boot_checksum(b"123456789"))
    '0x376e6e7'
    """
    crc = 0xFFFF_FFFF
    for byte in data:
        crc ^= byte << 24
        for _ in range(8):
            crc = (crc << 1 ^ (0x04C1_1DB7 if crc >> 31 else 0)) & 0xFFFF_FFFF
    return crc


def with_checksum(program: bytes) -> bytes:
    """The program with the checksum in the last four bytes of its boot block."""
    boot = program[: BLOCK - 4]
    if any(program[BLOCK - 4 : BLOCK]):
        raise ValueError("the boot block leaves no room for its checksum")
    return boot + struct.pack("<I", boot_checksum(boot)) + program[BLOCK:]


def uf2(program: bytes, address: int = FLASH) -> bytes:
    """A flash image as UF2."""
    blocks = [program[i : i + BLOCK].ljust(BLOCK, b"\0") for i in range(0, len(program), BLOCK)]
    out = b""
    for number, data in enumerate(blocks):
        where = address + number * BLOCK
        out += struct.pack(
            "<8I476sI", _START0, _START1, _HAS_FAMILY, where, BLOCK, number, len(blocks), FAMILY_RP2040, data, _END
        )
    return out


if __name__ == "__main__":
    source, target = map(Path, sys.argv[1:])
    target.write_bytes(uf2(with_checksum(source.read_bytes())))

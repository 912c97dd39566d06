"""Intel HEX: lines of ``:`` count, address, type, bytes, checksum, all in hexadecimal.

Intel, Hexadecimal Object File Format Specification, 1988.
"""


def parse_intel_hex(text: str) -> bytes:
    """The bytes from address 0 on; between records 0xFF, as in empty flash.

    Raises ValueError, naming the line, for what is no such file.

    >>> parse_intel_hex(":020000000C94 5E\\n:00000001FF".replace(" ", "")).hex()
    '0c94'
    """
    flash, base = bytearray(), 0
    for i, line in enumerate(text.split(), 1):
        record = bytes.fromhex(line[1:])
        if line[:1] != ":" or len(record) < 5 or record[0] != len(record) - 5 or sum(record) % 256:
            raise ValueError(f"line {i}: no record of Intel HEX: {line[:60]}")
        address, kind, payload = base + int.from_bytes(record[1:3], "big"), record[3], record[4:-1]
        if kind == 1:
            return bytes(flash)
        if kind in (2, 4):  # a segment, in units of 16; the upper half of addresses
            base = int.from_bytes(payload, "big") << (4 if kind == 2 else 16)
        elif kind == 0:
            flash.extend(b"\xff" * (address + len(payload) - len(flash)))
            flash[address : address + len(payload)] = payload
    raise ValueError("the file ends without its last record")

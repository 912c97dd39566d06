"""The simulated board's setup by the host: its configuration, drivers and servo pulses."""

import zlib

from armkin.board.firmware.wire.protocol import AxisImage, Error, Image
from armkin.board.sim.frame_fields import RefusedError, image_valid
from armkin.board_catalogue import Board


class Setup:
    """The active configuration, the bytes of the next one, drivers and servo pulses."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self.reset()

    def reset(self) -> None:
        """Reset to a board without a configuration."""
        board, n = self.board, len(self.board.axes)
        self._bytes = bytearray(12 + 21 * n + (1 + n) * len(board.switches) + (8 + 2 * n) * board.rows)
        self.image = Image(tuple(AxisImage() for _ in board.axes))
        self.crc = 0  # CRC of the configuration; 0: not configured
        self.drivers = self.pulses = False
        self.retained = False  # over a reset

    def retain(self, image: bytes, drivers: bool) -> None:
        """Restore the state before a reset; `image` is empty without a configuration."""
        if image:
            self._bytes[: len(image)] = image
            self.image = Image.unpack(image, len(self.board.switches)) or self.image
            self.crc = zlib.crc32(image)
        self.drivers, self.retained = drivers, True

    def packed_image(self) -> bytes:
        """The configuration's bytes, none if there is no configuration."""
        return self.image.pack() if self.crc else b""

    def write(self, offset: int, piece: bytes) -> None:
        """Write bytes of the next configuration, which deactivates the old one and switches all off."""
        if offset + len(piece) > len(self._bytes):
            raise RefusedError(Error.VALUE)
        self._bytes[offset : offset + len(piece)] = piece
        self.crc = 0
        self.drivers = self.pulses = self.retained = False

    def commit(self, length: int, crc: int) -> None:
        """Activate the written configuration if all its fields are in range."""
        raw = bytes(self._bytes[:length])
        image = Image.unpack(raw, len(self.board.switches))
        if image is None or len(raw) != length or zlib.crc32(raw) != crc or not image_valid(image, self.board):
            raise RefusedError(Error.CONFIG_BAD)
        self.image, self.crc = image, crc

    def servo(self, axis: int) -> bool:
        """Whether an axis is a servo."""
        return bool(self.board.servo_mask >> axis & 1)

    def uses_axis(self, axis: int) -> bool:
        """Whether the configuration uses an axis."""
        return axis < len(self.image.axes) and self.image.axes[axis].used

    def is_powered(self, axis: int) -> bool:
        """Whether an axis has its drivers, or its pulses, on."""
        return self.pulses if self.servo(axis) else self.drivers

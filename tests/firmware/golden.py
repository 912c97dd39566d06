"""Reads the golden conversations of firmware/golden and replays them on the emulated board."""

from __future__ import annotations

from dataclasses import dataclass

from emulator import FIRMWARE, EmulatedBoard

from armkin.board.firmware.wire import protocol

CREDIT = 0x83


@dataclass(frozen=True)
class Talk:
    """One conversation (golden/README.md has the form of its lines)."""

    name: str
    board: str
    lines: tuple[str, ...]

    def replay(self, board: EmulatedBoard) -> int:
        """Hold it with a board that has just been powered; the number of answers compared."""
        splitter = protocol.Splitter()
        answers: list[bytes] = []
        compared = 0

        def run(seconds: float, data: bytes = b"", until: bytes = b"") -> None:
            payloads = splitter.feed(board.run(seconds, data, until=until))
            answers.extend(p for p in payloads if p[0] != CREDIT)

        run(0.02)
        for number, line in enumerate(self.lines, 1):
            word, _, argument = line.partition("#")[0].strip().partition(" ")
            context = f"{self.name}:{number}"
            if word == ">":
                run(0.1, protocol.encode_frame(bytes.fromhex(argument)), until=b"\0")
            elif word == "wire":
                run(0.03, bytes.fromhex(argument))
            elif word == "<":
                assert answers, f"{context}: no answer"
                answer = answers.pop(0).hex()
                same = len(answer) == len(argument) and all(
                    w in ("?", g) for g, w in zip(answer, argument, strict=True)
                )
                assert same, f"{context}\n want {argument}\n got  {answer}"
                compared += 1
            elif word == "wait":
                run(float(argument) / 1000)
            elif word == "silent":
                run(0.02)
                assert not answers, f"{context}: {answers[0].hex()}"
            elif word == "reset":
                board.control("reset external")
                run(0.02)
            else:
                assert word in ("", "board"), f"{context}: {line}"
        assert not answers
        return compared


def read_talks() -> list[Talk]:
    """All conversations of firmware/golden."""
    conversations = []
    for path in sorted((FIRMWARE / "golden").glob("*.talk")):
        lines = tuple(path.read_text().splitlines())
        board = next(line.split()[1] for line in lines if line.startswith("board "))
        conversations.append(Talk(path.name, board, lines))
    return conversations

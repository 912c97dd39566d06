"""What a kind of board cannot promise is told once a day, not with every command."""

from __future__ import annotations

from pathlib import Path

import pytest

from armkin.cli.boards import board_link


def test_the_notes_of_a_port_come_once_a_day(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    for port, words, notes in (
        ("/dev/one", ["no checksum"], "note: no checksum"),
        ("/dev/one", ["no checksum"], ""),
        ("/dev/two", ["no checksum"], "note: no checksum"),
        ("/dev/one", ["another word"], "note: another word"),
        ("/dev/one", [], ""),
    ):
        board_link._once_a_day(port, words)
        assert capsys.readouterr().err.strip() == notes

"""Where locks, notes and compiled arms lie: in the user's own folders, wherever a program's temporary files go."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from armkin import user_folders
from armkin.board.ports import port_lock

HOLDER = "from armkin.board.ports.port_lock import holder_pid; import sys; print(holder_pid(sys.argv[1]))"


def test_a_port_is_locked_for_programs_with_other_temporary_folders(tmp_path: Path) -> None:
    """A service has a temporary folder of its own: two programs spoke with one arm."""
    name = str(tmp_path / "port")
    lock = port_lock.Lock(name)
    try:
        (tmp_path / "tmp").mkdir()
        env = os.environ | {"TMPDIR": str(tmp_path / "tmp")}
        completed = subprocess.run(
            [sys.executable, "-c", HOLDER, name], env=env, capture_output=True, text=True, check=True
        )
        assert completed.stdout == f"{os.getpid()}\n"
    finally:
        lock.release()


def test_notes_lie_in_a_folder_of_the_user_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    note = Path(port_lock.note_path("COM3"))
    if sys.platform == "linux":
        assert note.parent == tmp_path / "state/armkin/ports"
    assert note.parent.is_dir()
    assert os.name == "nt" or note.parent.stat().st_mode & 0o777 == 0o700


@pytest.mark.skipif(sys.platform != "linux", reason="what the environment says there")
def test_a_service_without_folders_has_temporary_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    assert user_folders.port_file_stem("abc") == f"{tempfile.gettempdir()}/armkin-{os.getuid()}-abc"


@pytest.mark.skipif(sys.platform != "linux", reason="what the environment says there")
def test_no_folder_is_where_somebody_happens_to_stand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A relative XDG folder is none, says its specification: a library lying there would be loaded."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("XDG_STATE_HOME", "state")
    monkeypatch.setenv("XDG_CACHE_HOME", "cache")
    assert Path(user_folders.port_file_stem("abc")).is_absolute()
    assert (user_folders.compiled_folder() or tmp_path / "home").is_relative_to(tmp_path / "home")
    assert not (tmp_path / "state").exists()

"""What is built is found again and never loaded torn; a compiler that cannot build says so in a line."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

import armkin
from armkin.compiled import toolchain

SOURCE = 'const char arm_content[] = "abc"; int answer(void); int answer(void) { return 42; }'


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache folder, of a user who has compiled nothing."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "armkin" / "compiled"


def answer_of_process(*words: str) -> subprocess.CompletedProcess[str]:
    """What a process of its own finds: a library that is torn may end it."""
    code = f"from armkin.compiled.toolchain import load_library; print(load_library({SOURCE!r}, 'abc').answer())"
    return subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=False)


def replace_library(library: Path, held: bytes, mode: int = 0o700) -> None:
    """Another file of that name: one that this process has loaded must not lose its pages, which its end still runs."""
    draft = library.with_suffix(".new")
    draft.write_bytes(held)
    draft.chmod(mode)
    draft.rename(library)


@pytest.mark.parametrize("size", [5000, 12288])
def test_a_torn_library_is_built_again(cache: Path, size: int) -> None:
    """The system's loader ends the process at the first page that is missing."""
    toolchain.load_library(SOURCE, "abc")
    [library] = cache.glob("*.so")
    assert library.stat().st_size > size
    replace_library(library, library.read_bytes()[:size])
    completed = answer_of_process()
    assert (completed.returncode, completed.stdout) == (0, "42\n")


def test_a_library_with_a_byte_changed_is_built_again(cache: Path) -> None:
    toolchain.load_library(SOURCE, "abc")
    [library] = cache.glob("*.so")
    held = library.read_bytes()
    place = held.index((42).to_bytes(4, "little"))
    replace_library(library, held[:place] + b"\x2b" + held[place + 1 :])
    assert answer_of_process().stdout == "42\n"
    assert [path.read_bytes() for path in cache.glob("*.so")] == [held]


@pytest.mark.parametrize("mode", [0o720, 0o702, 0o777])
def test_a_library_that_others_may_have_written_is_built_again(cache: Path, mode: int) -> None:
    """It has the name of what it holds, and says that it is what was asked for."""
    toolchain.load_library(SOURCE.replace("42", "43"), "abc")
    [false] = cache.glob("*.so")
    toolchain.load_library(SOURCE, "abc")
    [genuine] = set(cache.glob("*.so")) - {false}
    named = genuine.with_name(f"{genuine.stem.partition('-')[0]}-{false.stem.partition('-')[2]}.so")
    replace_library(named, false.read_bytes())
    genuine.unlink()
    false.unlink()
    assert answer_of_process().stdout == "43\n"  # as it would be believed
    named.chmod(mode)
    assert answer_of_process().stdout == "42\n"


def test_a_library_of_another_user_is_not_loaded(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    toolchain.load_library(SOURCE, "abc")
    [library] = cache.glob("*.so")
    name = library.stem.partition("-")[0]
    assert toolchain._stored_library(cache, name, "abc") is not None
    monkeypatch.setattr(os, "geteuid", lambda: library.stat().st_uid + 1)
    assert toolchain._stored_library(cache, name, "abc") is None
    assert toolchain._cache_folder() is None


def test_a_library_by_a_link_is_not_loaded(cache: Path, tmp_path: Path) -> None:
    """What it leads to may be another's folder."""
    toolchain.load_library(SOURCE, "abc")
    [library] = cache.glob("*.so")
    library.rename(tmp_path / library.name)
    library.symlink_to(tmp_path / library.name)
    assert toolchain._stored_library(cache, library.stem.partition("-")[0], "abc") is None


@pytest.mark.parametrize("above", [0, 1, 2])
def test_a_cache_in_a_folder_that_others_may_write_is_not_used(cache: Path, above: int) -> None:
    assert toolchain._cache_folder() == cache
    (cache, *cache.parents)[above].chmod(0o770)
    assert toolchain._cache_folder() is None


def test_the_cache_is_used_under_a_umask_of_groups(cache: Path) -> None:
    """002 is what Fedora gives its users, whose folders are then open to their group."""
    before = os.umask(0o002)
    try:
        toolchain.load_library(SOURCE, "abc")
    finally:
        os.umask(before)
    [library] = cache.glob("*.so")
    assert {stat.S_IMODE(path.stat().st_mode) for path in (*library.parents[:3], library)} == {0o700}
    built = library.stat().st_mtime_ns
    toolchain.load_library(SOURCE, "abc")
    assert library.stat().st_mtime_ns == built


def test_the_compiler_may_have_options(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "cc -DHALF=21")
    assert toolchain.load_library(SOURCE.replace("42", "2 * HALF"), "abc").answer() == 42


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("#!/bin/sh\nexit 0\n", "failed: it wrote no library"),
        ("#!/bin/sh\necho 'arm.c: error: no room' >&2\nexit 1\n", "failed: arm.c: error: no room"),
        ("no program", "cannot be run: Exec format error"),
    ],
)
def test_a_compiler_that_builds_nothing_is_named(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str, message: str
) -> None:
    path = tmp_path / "my cc"
    path.write_text(script)
    path.chmod(0o700)
    monkeypatch.setenv("CC", str(path))
    with pytest.raises(armkin.ArmkinError, match=message):
        toolchain.load_library(SOURCE, "abc")
    assert not list(cache.glob("*"))


def test_a_cache_that_takes_nothing_more_is_done_without(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(source: str, target: str | Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    assert toolchain.load_library(SOURCE, "abc").answer() == 42
    assert not list(cache.glob("*"))


def test_no_place_to_build_is_said(cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))
    with pytest.raises(armkin.FileError, match=r"no place to build the arm's code: .*TMPDIR"):
        toolchain.load_library(SOURCE, "abc")


def test_a_compiler_that_takes_too_long_to_optimise_does_not(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "slow"
    path.write_text('#!/bin/sh\ncase "$*" in *-O3*) exec sleep 600 ;; esac\nexec cc "$@"\n')
    path.chmod(0o755)
    monkeypatch.setenv("CC", str(path))
    monkeypatch.setattr(toolchain, "MAX_SECONDS", 1.0)
    announced: list[str] = []
    monkeypatch.setattr(toolchain, "announce", lambda: announced.append("built"))
    source = 'const char arm_content[] = "slow"; int half(int x) { return x / 2; }\n'
    assert toolchain.load_library(source, "slow").half(84) == 42
    assert toolchain.load_library(source, "slow").half(84) == 42, "kept, and not waited for again"
    assert announced == ["built"]
    monkeypatch.setattr(time, "time", lambda now=time.time: now() + 86_400)
    assert toolchain.load_library(source, "slow").half(84) == 42
    assert announced == ["built"] * 2, "tried again the next day"

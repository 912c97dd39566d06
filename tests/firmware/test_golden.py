"""The compiled firmware answers the golden conversations byte for byte."""

import pytest
from emulator import FIRMWARE, EmulatedBoard
from golden import Talk, read_talks


@pytest.mark.parametrize("talk", read_talks(), ids=lambda talk: talk.name)
def test_the_firmware_answers_as_written(talk: Talk) -> None:
    with EmulatedBoard(talk.board, speed="step") as board:
        assert talk.replay(board) >= 2


def test_a_bootloader_that_hides_the_cause_changes_nothing() -> None:
    talk = next(t for t in read_talks() if t.name == "servos.talk")
    with EmulatedBoard(talk.board, speed="step", bootloader=0.01) as board:
        assert talk.replay(board) > 10


def test_all_that_generate_writes_is_committed(tmp_path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    import importlib.util

    folder = FIRMWARE / "golden"
    monkeypatch.syspath_prepend(str(folder))
    spec = importlib.util.spec_from_file_location("generate_golden", folder / "generate.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "HERE", tmp_path)
    module.main()
    written = {p.name: p.read_text() for p in tmp_path.iterdir()}
    assert written == {p.name: p.read_text() for p in folder.iterdir() if p.suffix in (".talk", ".txt")}

"""The public names: all there, found lazily, and cheap to import."""

import ast
import subprocess
import sys
from importlib import import_module

import pytest

import armkin
from command_line import ROOT

HEAVY = ("numpy", "pydantic", "yaml", "serial", "rich", "matplotlib")


@pytest.mark.parametrize("name", armkin.__all__)
def test_every_public_name_is_there_and_documented(name: str) -> None:
    value = getattr(armkin, name)
    assert name in dir(armkin)
    assert name == "__version__" or (value.__doc__ or "").strip()


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse((ROOT / "src/armkin/__init__.py").read_text())
    [block] = [node for node in tree.body if isinstance(node, ast.If)]
    seen = {
        alias.asname: (node.module, alias.name)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == {name: (f"armkin.{module}", name) for name, module in armkin._HOME.items()}


def test_an_unknown_name_lists_the_names() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'fkk'; it has .*fk"):
        armkin.fkk  # noqa: B018


@pytest.mark.parametrize("name", ["ik", "pulses", "lock", "workspace"])
def test_functions_stay_functions_when_their_modules_are_imported(name: str) -> None:
    import_module(f"armkin.{name}")
    assert callable(getattr(armkin, name))
    code = f"import armkin.{name}, armkin; assert callable(armkin.{name})"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)


@pytest.mark.parametrize(
    "code",
    [
        "import armkin; armkin.UsageError",
        "from armkin.cli.app import run; run(['--help'])",
        "from armkin.cli.app import run; run(['--version'])",
    ],
)
def test_start_up_imports_nothing_heavy(code: str) -> None:
    report = f"{code}\nimport sys; print('LOADED', *sorted({{m.partition('.')[0] for m in sys.modules}}))"
    done = subprocess.run(
        [sys.executable, "-c", report], capture_output=True, text=True, check=True, cwd=ROOT
    )
    loaded = done.stdout.rpartition("LOADED")[2].split()
    assert not set(HEAVY) & set(loaded)

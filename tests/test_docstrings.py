"""What needs a docstring has one; those of the public names say what goes in and out and is raised, in one format."""

from __future__ import annotations

import ast
import dataclasses
import enum
import inspect
import re
from collections.abc import Callable, Iterable, Iterator
from functools import cached_property
from runpy import run_path
from typing import Any

import pytest

import armkin
from armkin import errors
from command_line import ROOT
from source_trees import FUNCTION, nodes_of

SECTION = re.compile(r"^(Args|Attributes|Returns|Raises):\n((?:(?:    .*)?\n?)*)", re.M)
ENTRY = re.compile(r"^    \*{0,2}(\w+): *(\S.*(?:\n {6,}.*)*)", re.M)  # a name, what it is, and lines indented more
SHAPE = re.compile(r"^\((?:\.\.\.|\d+|[A-Za-z]\w*| [+-] |, ?)*\)")  # (), (..., n), (N, 3)
UNIT = re.compile(r"\[[^]]+\]")
# Words that lean on the text before: `help()` shows none.
WITHOUT_NOUN = re.compile(r"(Those|These|They|Them|Its?|And|But|Or|Of|As|By|The same|One of them|So many|At many)\b")
ARRAYS = ("ArrayLike", "Array", "NDArray", "Joints", "Points", "Poses", "Frames", "Jacobians", "Figures", "Pulses")


def _public_callables() -> Iterator[tuple[str, Any]]:
    """Every exported callable, the classes of results, and of classes what they define in public."""
    exported = {name: getattr(armkin, name) for name in armkin.__all__}
    for name, value in {**exported, **{kind.__name__: kind for kind in _result_classes(exported.values())}}.items():
        if callable(value):
            yield name, value
        if inspect.isclass(value):
            for inner, member in vars(value).items():
                if not inner.startswith("_") and (inspect.isfunction(member) or _is_property(member)):
                    yield f"{name}.{inner}", member


def _result_classes(functions: Iterable[Any]) -> Iterator[Any]:
    """The dataclasses that functions return."""
    for function in filter(inspect.isfunction, functions):
        named = re.findall(r"\w+", inspect.signature(function).return_annotation)
        yield from filter(dataclasses.is_dataclass, map(function.__globals__.get, named))


def _is_property(member: Any) -> bool:
    return isinstance(member, property | cached_property)


PUBLIC = dict(_public_callables())
FUNCTIONS = {name: value for name, value in PUBLIC.items() if inspect.isfunction(value)}
READ = {name: value for name, value in PUBLIC.items() if _is_property(value)}
CLASSES = {name: value for name, value in PUBLIC.items() if inspect.isclass(value)}


def _section_texts(of: Any) -> dict[str, str]:
    text = (inspect.getdoc(of) or "") + "\n"
    return dict(SECTION.findall(text))


def _section_entries(of: Any, section: str) -> dict[str, str]:
    return {name: " ".join(text.split()) for name, text in ENTRY.findall(_section_texts(of).get(section, ""))}


def _parameter_names(of: Callable[..., Any]) -> list[str]:
    return [name for name in inspect.signature(of).parameters if name != "self"]


def _has_shape_and_unit(annotation: str, text: str) -> bool:
    """An array's shape comes first; numbers with fractions have a unit in brackets, [1] if they have none."""
    kind = annotation.removesuffix(" | None")
    shaped = kind.partition("[")[0] in ARRAYS
    counted = kind == "Pulses" or kind.startswith("NDArray")
    return (not shaped or SHAPE.match(text) is not None) and (
        counted or not (shaped or kind == "float") or UNIT.search(text) is not None
    )


def test_there_is_something_to_read() -> None:
    assert len(FUNCTIONS) > 40
    assert len(CLASSES) > 12


def test_every_class_and_public_function_has_a_docstring() -> None:
    """Methods, too, those of private classes included; a setter's is its property's."""
    silent = {
        f"{module}.{node.name}"
        for module, owner in nodes_of(ast.Module | ast.ClassDef)
        for node in owner.body
        if isinstance(node, ast.ClassDef) or (isinstance(node, ast.FunctionDef) and _is_public(node))
        if ast.get_docstring(node, clean=False) is None
    }
    assert not silent


def test_every_function_of_more_than_25_lines_has_a_docstring() -> None:
    """Private ones, too: nobody reads so many lines to learn what they are for."""
    silent = {
        f"{module}.{node.name}"
        for module, node in nodes_of(ast.FunctionDef)
        if node.name != "__init__" and ast.get_docstring(node) is None and node.end_lineno - node.lineno >= 25
    }
    assert not silent


def _is_public(node: ast.FunctionDef) -> bool:
    return not node.name.startswith("_") and not any(
        ast.unparse(one).endswith(".setter") for one in node.decorator_list
    )


def test_every_docstring_names_what_it_is_about() -> None:
    leaning = [
        f"{module}:{node.lineno} {text}"
        for module, node in nodes_of(FUNCTION | ast.ClassDef)
        if WITHOUT_NOUN.match(text := ast.get_docstring(node) or "")
    ]
    assert not leaning


@pytest.mark.parametrize("name", PUBLIC)
def test_the_first_line_is_a_sentence_by_itself(name: str) -> None:
    first, *rest = (inspect.getdoc(PUBLIC[name]) or "").splitlines()
    assert first.endswith(".")
    assert not rest or not rest[0], "a summary is one line"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_parameter_has_a_line(name: str) -> None:
    told = _section_entries(FUNCTIONS[name], "Args")
    assert list(told) == _parameter_names(FUNCTIONS[name])
    parameters = inspect.signature(FUNCTIONS[name]).parameters
    assert not {given for given, text in told.items() if not _has_shape_and_unit(parameters[given].annotation, text)}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_what_is_returned_is_told(name: str) -> None:
    annotation = inspect.signature(FUNCTIONS[name]).return_annotation
    told = " ".join(_section_texts(FUNCTIONS[name]).get("Returns", "").split())
    assert bool(told) == (annotation != "None")
    assert _has_shape_and_unit(annotation, told)


@pytest.mark.parametrize("name", [name for name in FUNCTIONS if "." not in name])
def test_what_is_raised_is_told(name: str) -> None:
    told = _section_entries(FUNCTIONS[name], "Raises")
    assert told
    assert all(issubclass(getattr(errors, error), armkin.ArmkinError) for error in told)


@pytest.mark.parametrize("name", READ)
def test_of_an_array_that_is_read_the_shape_is_told(name: str) -> None:
    getter: Callable[..., Any] = getattr(READ[name], "fget", None) or READ[name].func
    text = inspect.getdoc(getter) or ""
    assert _has_shape_and_unit(inspect.signature(getter).return_annotation, text)


@pytest.mark.parametrize("name", CLASSES)
def test_every_field_has_a_line(name: str) -> None:
    kind = CLASSES[name]
    if dataclasses.is_dataclass(kind):
        told = [(field.name, str(field.type)) for field in dataclasses.fields(kind)]
    elif issubclass(kind, enum.Enum):
        told = [(member, "") for member in kind.__members__]
    else:
        assert list(_section_entries(kind, "Args")) == (_parameter_names(kind) if "__init__" in vars(kind) else [])
        return
    lines = _section_entries(kind, "Attributes")
    assert list(lines) == [field for field, _ in told]
    assert not {field for field, type_ in told if not _has_shape_and_unit(type_, lines[field])}


def test_the_reference_has_a_row_for_every_parameter_and_field() -> None:
    page = "\n".join(run_path(str(ROOT / "scripts/site.py"))["python"]())
    heads = re.split(r"^##+ (.*)$", page, flags=re.M)
    text = dict(zip(heads[1::2], heads[2::2], strict=True))
    assert text.keys() == PUBLIC.keys()
    for name, member in PUBLIC.items():
        told = {
            **_section_entries(member, "Args"),
            **_section_entries(member, "Attributes"),
            **_section_entries(member, "Raises"),
        }
        assert re.findall(r"^\| `\*{0,2}(\w+)` \| ", text[name], re.M) == list(told), name

"""A robot file's text with other values: comments, order and spelling of all else stay."""

from collections.abc import Mapping
from typing import Any

import yaml

Path = tuple[str | int, ...]


def with_values(text: str, values: Mapping[Path, float | int | str]) -> str:
    """A robot file's text with values replaced, or added at the end of the mapping where the key is missing.

    values: where -> what, as ``("joints", 0, "drive", "zero"): 2048``. Raises KeyError for a path whose mapping is
    not there.

    >>> with_values("a: {b: 1}  # one", {("a", "b"): 2, ("a", "c"): 3})
    'a: {b: 2, c: 3}  # one'
    """
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    edits: list[tuple[int, int, str]] = []
    for path, value in values.items():
        mapping = _node_at(root, path[:-1])
        value_node = next((node for key, node in mapping.value if key.value == path[-1]), None)
        end_index = mapping.value[-1][1].end_mark.index
        if value_node is not None:
            edits.append((value_node.start_mark.index, value_node.end_mark.index, str(value)))
        elif mapping.flow_style:
            edits.append((end_index, end_index, f", {path[-1]}: {value}"))
        else:
            column = mapping.value[0][0].start_mark.column
            end = end_index if text[:end_index].endswith("\n") else text.find("\n", end_index) + 1 or len(text)
            edits.append((end, end, f"{' ' * column}{path[-1]}: {value}\n"))
    for begin, end, replacement in sorted(edits, reverse=True):
        text = text[:begin] + replacement + text[end:]
    return text


def _node_at(node: Any, path: Path) -> Any:
    for step in path:
        if isinstance(step, int):
            node = node.value[step]
        else:
            node = next((value for key, value in node.value if key.value == step), None)
            if node is None:
                raise KeyError(step)
    return node

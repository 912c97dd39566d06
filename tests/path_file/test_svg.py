"""SVG: outlines as an independent reading of SVG 1.1 draws them, or a refusal with line and name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from armkin.errors import PathFileError
from armkin.path_file import svg
from armkin.path_file.drawing import DrawingOptions, Placing
from command_line import run

AS_IT_IS = Placing((0.0, 0.0, 0.0), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
BOX = 'viewBox="0 0 100 100" width="100mm" height="100mm"'


def drawn_points(body: str, head: str = BOX, lift: float = 0.0) -> np.ndarray:
    """All points, (N, 3) [mm]."""
    text = f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="x" {head}>\n{body}</svg>'
    points: list[list[float]] = []
    for move in svg.parse_svg(text.encode(), "t.svg", AS_IT_IS, DrawingOptions(lift=lift)).moves:
        if move.point is not None:
            points.append(list(move.point))
        points += move.polyline or []
    return np.array(points)


@pytest.mark.parametrize(
    ("body", "points"),
    [
        ('<path d="M10 10h10v10H10z"/>', [[10, 90], [20, 90], [20, 80], [10, 80], [10, 90]]),
        ('<path d="m10,10 10,0 0,10-10-.5.5.5z"/>', [[10, 90], [20, 90], [20, 80], [10, 80.5], [10.5, 80], [10, 90]]),
        ('<g transform="translate(10 20) rotate(90)"><line x2="5"/></g>', [[10, 80], [10, 75]]),
        ('<g transform="matrix(2 0 0 2 1 1) scale(2,1)"><line x2="5" y2="1"/></g>', [[1, 99], [21, 97]]),
        ('<polygon points="1,1 2,1 2 2"/>', [[1, 99], [2, 99], [2, 98], [1, 99]]),
        ('<polyline points="1,1 2,1 2 2"/>', [[1, 99], [2, 99], [2, 98]]),
        ('<defs><path id="r" d="M0 0h4"/></defs><use xlink:href="#r" x="10" y="3"/>', [[10, 97], [14, 97]]),
        ('<rect x="1" y="1" width="3" height="2"/>', [[1, 99], [4, 99], [4, 97], [1, 97], [1, 99]]),
        ('<path d="M1 1h2" style="display:none"/><path d="M5 5h2"/>', [[5, 95], [7, 95]]),
    ],
)
def test_shapes_with_corners(body: str, points: list[list[float]]) -> None:
    corners = drawn_points(body)[:, :2]
    keep = np.append(True, np.abs(np.diff(corners, axis=0)).max(axis=1) > 1e-9)
    np.testing.assert_allclose(corners[keep], points, atol=1e-9)


@pytest.mark.parametrize(
    "body",
    [
        '<circle cx="50" cy="50" r="20"/>',
        '<path d="M30 50a20 20 0 1040 0A20 20 0 0030 50"/>',
        '<ellipse cx="25" cy="50" rx="10" ry="20" transform="scale(2 1)"/>',
        '<rect x="30" y="30" width="40" height="40" rx="20"/>',
    ],
)
def test_round_shapes(body: str) -> None:
    points = drawn_points(body)
    np.testing.assert_allclose(np.hypot(points[:, 0] - 50, points[:, 1] - 50), 20, atol=1e-9)
    middle = (points[1:] + points[:-1]) / 2
    assert np.hypot(middle[:, 0] - 50, middle[:, 1] - 50).min() > 20 - 0.01


def test_curves() -> None:
    t = np.linspace(0, 1, 5000)[:, None]
    P = [np.array(p, dtype=float) for p in ((0, 100), (0, 90), (10, 90), (10, 100))]
    exact = (1 - t) ** 3 * P[0] + 3 * (1 - t) ** 2 * t * P[1] + 3 * (1 - t) * t**2 * P[2] + t**3 * P[3]
    points = drawn_points('<path d="M0 0C0 10 10 10 10 0"/>')[:, :2]
    assert max(np.linalg.norm(exact - p, axis=1).min() for p in (points[1:] + points[:-1]) / 2) < 0.01
    smooth = drawn_points('<path d="M0 0C0 10 10 10 10 0S20-10 20 0"/>')[:, :2]
    spelled = drawn_points('<path d="M0 0C0 10 10 10 10 0C10-10 20-10 20 0"/>')[:, :2]
    np.testing.assert_allclose(smooth, spelled, atol=1e-12)
    np.testing.assert_allclose(
        drawn_points('<path d="M0 0q5 10 10 0t10 0"/>'),
        drawn_points('<path d="M0 0Q5 10 10 0Q15-10 20 0"/>'),
        atol=1e-12,
    )


def test_units_and_the_frame() -> None:
    line = '<line x1="0" y1="0" x2="96" y2="0"/>'
    np.testing.assert_allclose(
        drawn_points(line, 'width="2in" height="1in"')[:, :2], [[0, 25.4], [25.4, 25.4]], atol=1e-9
    )
    boxed = drawn_points('<line x1="10" y1="20" x2="30" y2="20"/>', 'viewBox="10 10 40 20" width="80mm" height="40mm"')
    np.testing.assert_allclose(boxed[:, :2], [[0, 20], [40, 20]], atol=1e-9)
    np.testing.assert_allclose(drawn_points(line, 'viewBox="0 0 96 96"')[:, :2], [[0, 25.4], [25.4, 25.4]], atol=1e-9)


def test_the_pen_is_lifted_between_strokes() -> None:
    points = drawn_points('<path d="M0 100h10M20 100h10"/>', lift=5.0)
    assert points[:, 2].tolist() == [5, 0, 0, 5, 5, 0, 0, 5]
    assert points[:, 0].tolist() == [0, 0, 10, 10, 20, 20, 30, 30]


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ('<text x="1">a</text>', "t.svg:2: <text> is not drawn"),
        ('<rect clip-path="url(#a)" width="1" height="1"/>', "t.svg:2: <rect> has clip-path"),
        ('<path d="X"/>', "path data: 'X' is not known"),
        ('<path d="M0 0L1"/>', "L needs 2 numbers"),
        ('<path d="L1 1"/>', "it begins with M"),
        ('<path d="M0 0A1 1 0 2 0 3 3"/>', "flag is 0 or 1"),
        ('<use href="#q"/>', "uses '#q', which is not in this file"),
        ('<g id="a"><use href="#a"/></g>', "or uses itself"),
        ('<circle r="a"/>', "'a' is no length"),
        ('<g transform="foo(1)"><line x2="1"/></g>', "transform 'foo.1.' is not known"),
        ('<svg><line x2="1"/></svg>', "stands inside of another"),
        ("", "t.svg:2: draws nothing up to here: it needs an outline of circle, ellipse, line, path"),
        ("<g>", "is not XML"),
    ],
)
def test_what_is_refused_names_line_and_element(body: str, words: str) -> None:
    with pytest.raises(PathFileError, match=words):
        drawn_points(body)


@pytest.mark.parametrize(
    ("raw", "words"),
    [
        (b"", "t.svg:1: is not XML: no element found"),
        (b"hello", "t.svg:1: is not XML: syntax error"),
        (b"\x1f\x8b\x08\0\0", "t.svg:1: is not XML"),
        (b'\n\n<svg>\n<path d="M0 0L1 1 \xff"/></svg>', "t.svg:4: is not XML"),
        (b'<?xml version="1.0" encoding="klingon"?><svg/>', "t.svg:1: is not XML"),
        (b"<html/>", "t.svg:1: is <html>, and no <svg>"),
        (b'<svg viewBox="0 0 nan 1"><line x2="1"/></svg>', "t.svg:1: <svg>: '0 0 nan 1' has what is no number"),
        (b'<svg viewBox="0 0 0 0"><line x2="1"/></svg>', "the last two above 0"),
        (b'<svg viewBox="0 0 1 1" width="-5mm"><line x2="1"/></svg>', "width -5mm is below 0"),
        (b'<svg viewBox="0 0 1 1" height="0"><line x2="1"/></svg>', "above 0, or left out"),
        (b"<svg>" + b"<g>" * 100_000, "elements in each other deeper"),
        (b'<!DOCTYPE svg [<!ENTITY x SYSTEM "file:///etc/hostname">]>\n<svg><path d="&x;"/></svg>', "t.svg:1: has ent"),
        (b'<!DOCTYPE svg [<!ENTITY % p SYSTEM "http://127.0.0.1:9/x">%p;]>\n<svg/>', "t.svg:1: has entities"),
        (b'<svg><path d="M0 0' + b"L1 1" * 130_000 + b'"/></svg>', "beyond 120000 points"),
    ],
)
def test_files_that_are_no_drawing_are_refused_with_their_line(raw: bytes, words: str) -> None:
    with pytest.raises(PathFileError) as refused:
        svg.parse_svg(raw, "t.svg", AS_IT_IS, DrawingOptions())
    assert words in str(refused.value)


def test_a_document_type_elsewhere_is_not_fetched() -> None:
    head = b'<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://127.0.0.1:9/svg11.dtd">'
    drawn_ = svg.parse_svg(head + b'<svg viewBox="0 0 1 1"><line x2="1"/></svg>', "t.svg", AS_IT_IS, DrawingOptions())
    assert len(drawn_.moves) > 0


def test_entities_and_bombs_of_uses_are_refused() -> None:
    bomb = b'<!DOCTYPE svg [<!ENTITY a "aaaa">]><svg><path d="&a;"/></svg>'
    with pytest.raises(PathFileError, match="entities"):
        svg.parse_svg(bomb, "t.svg", AS_IT_IS, DrawingOptions())
    uses = '<g id="g0"/>'
    for k in range(1, 12):
        uses += f'<g id="g{k}">' + 10 * f'<use href="#g{k - 1}"/>' + "</g>"
    with pytest.raises(PathFileError, match="more than"):
        drawn_points(f'<defs>{uses}</defs><use href="#g11"/>')


def test_a_drawing_is_planned(tmp_path: Path) -> None:
    file = tmp_path / "d.svg"
    file.write_text('<svg viewBox="0 0 40 40" width="40mm" height="40mm"><circle cx="20" cy="20" r="15"/></svg>')
    plan = run("path", "three_dof", file, "--at", "320,0,250", "--feed", "60", "--json").json
    assert plan["length_mm"] == pytest.approx(2 * np.pi * 15 + 10, abs=0.5)
    assert plan["deviation_mm"] <= 0.05

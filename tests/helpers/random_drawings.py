"""Programs and drawings at random, in the styles of slicers, CAM, plotters, senders' tests and drawing programs."""

from __future__ import annotations

import numpy as np

# Lines that spoil a drawing, and what their refusal says behind the element's name.
BROKEN_ELEMENTS = (
    ('<path d="M0 0L1"/>', "L needs 2 numbers"), ('<path d="M0 0B1 1"/>', "'B' is not known"),
    ('<path d="L1 1"/>', "it begins with M"), ('<path d="M1..2 3L2 2"/>', "L needs 2 numbers"),
    ('<path d="M,,1 1L2 2"/>', "M needs 2 numbers"), ('<path d="M nan 0L1 1"/>', "M needs 2 numbers"),
    ('<path d="M1e999 0L1 1"/>', "larger than 1e+09"), ('<path d="M0 0A1 1 0 2 0 3 3"/>', "flag is 0 or 1"),
    ('<path d="M0 0A1e300 1e300 0 0 0 1 1"/>', "larger than 1e+09"), ('<path d="M1e7 0L1 1"/>', "farther away"),
    ('<path d="M0 0C1e8 0 0 1e8 1 1"/>', "more than 20000 chords"), ('<circle r="-5"/>', "r -5 is below 0"),
    ('<circle r="10%"/>', "'10%' is no length"), ('<circle r="1e200"/>', "larger than 1e+09"),
    ('<rect width="-1" height="1"/>', "width -1 is below 0"),
    ('<rect width="4" height="4" rx="-1"/>', "rx -1 is below 0"),
    ('<polyline points="1 2 3"/>', "odd count"), ('<polyline points="1 2 a b"/>', "has what is no number"),
    ('<line x2="3em"/>', "'3em' is no length"), ('<line x2="1furlong"/>', "is no length"),
    ('<g transform="matrix(1 2 3 4 5)"><line x2="1"/></g>', "matrix has 5 numbers; it takes 6"),
    ('<g transform="rotate(1) foo(2)"><line x2="1"/></g>', "is not known"),
    ('<g transform="scale(1e8) scale(1e8)"><line x2="1"/></g>', "farther away"),
    ('<use href="http://example.org/x.svg#a"/>', "which is not in this file"),
    ('<use href="file:///etc/hostname"/>', "which is not in this file"), ("<use/>", "which is not in this file"),
    ('<use id="self" href="#self"/>', "uses itself"), ("<text>a</text>", "is not drawn"),
    ('<image href="a.png"/>', "is not drawn"),
    ("<foreignObject/>", "is not drawn"), ("<switch/>", "is not drawn"), ("<svg/>", "inside of another"),
    ('<line x2="1" clip-path="url(#x)"/>', "has clip-path"), ('<g style="mask:url(#m)"><line x2="1"/></g>', "has mask"),
    ('<path d="M0 0" d="M1 1"/>', "is not XML: duplicate attribute"), ("<g>&nbsp;</g>", "is not XML: undefined entity"),
    ("<g =>", "is not XML: "), ("</g>", "is not XML: mismatched tag"), ("<path d=M0/>", "is not XML: "),
)  # fmt: skip


def random_program(seed: int) -> str:
    """A G-code program."""
    rng = np.random.default_rng(seed)
    return (_slicer_program, _cam_program, _plotter_program, _sender_program)[seed % 4](rng)


def _text(x: float, digits: int = 3) -> str:
    text = f"{x:.{digits}f}"
    return text.rstrip("0") if text.endswith("0") and "." in text else text


def _slicer_program(rng: np.random.Generator) -> str:
    lines = [";FLAVOR:Marlin", "M140 S60", "M104 S205 ; hotend", "G21", "G90", "M82", "G28 ;home", "G92 E0"]
    e = 0.0
    for layer in range(int(rng.integers(1, 4))):
        z = 0.2 + 0.2 * layer
        lines += [
            f";LAYER:{layer}",
            "M106 S85" if layer else "M107",
            f"G0 F6000 X20 Y20 Z{_text(z)}",
            ";TYPE:WALL-OUTER",
        ]
        sides, r = int(rng.integers(3, 60)), rng.uniform(5, 15)
        for k, a in enumerate(np.linspace(0, 2 * np.pi, sides + 1)):
            e += 0.05
            lines.append(f"{'G0 F9000' if k == 0 else 'G1 F1200' if k == 1 else 'G1'} "
                       f"X{_text(20 + r * np.cos(a))} Y{_text(20 + r * np.sin(a))} E{e:.5f}")  # fmt: skip
        lines += ["G1 F2400 E-1", ";TYPE:FILL", "G91", f"G1 Z{_text(rng.uniform(0.1, 1))} F600", "G90"]
        for k in range(int(rng.integers(2, 8))):
            y = 12 + k * 1.2
            lines += [
                f"G1 X{10 if k % 2 else 30} Y{_text(y)} E{e:.5f}",
                f"G1 X{10 if k % 2 else 30} Y{_text(y + 1.2)}",
            ]
    return "\n".join([*lines, "M104 S0", "G92 E0", "M84 X Y E"]) + "\n"


def _cam_program(rng: np.random.Generator) -> str:
    inch = rng.random() < 0.5
    k = 1 / 25.4 if inch else 1.0
    lines = ["%", "O1001 (POCKET)", "G17 G40 G49 G80 G90 " + ("G20" if inch else "G21"), "T1 M6", "S12000 M3", "G54"]
    lines.append(f"G0 X{_text(10 * k, 4)} Y{_text(10 * k, 4)}")
    lines += [f"Z{_text(5 * k, 4)}", f"G1 Z{_text(-1 * k, 4)} F{_text(300 * k, 1)}"]
    for _ in range(int(rng.integers(2, 9))):
        how, r = int(rng.integers(5)), rng.uniform(2, 9) * k
        word = "G2" if rng.random() < 0.5 else "G3"
        if how == 0:
            lines.append(f"{word} I{_text(r, 4)} J{_text(0.5 * r, 4)}")  # a whole circle
        elif how == 1:
            lines.append(f"G91 {word} X{_text(2 * r, 4)} Y0 I{_text(r, 4)} J0 Z{_text(rng.uniform(-1, 1) * k, 4)}")
            lines.append("G90")
        elif how == 2:
            axes, first_axis, two = (("G18", "X", "Z"), ("G19", "Y", "Z"))[int(rng.integers(2))]
            i, j = ("I", "K") if axes == "G18" else ("J", "K")
            lines += [
                f"{axes} G91 {word} {first_axis}{_text(r, 4)} {two}{_text(r, 4)} {i}{_text(r, 4)} {j}0",
                "G17 G90",
            ]
        elif how == 3:
            lines.append(f"G1 X{_text(rng.uniform(0, 40) * k, 4)} Y{_text(rng.uniform(0, 40) * k, 4)}")
        else:
            lines.append(f"G91 {word} P{int(rng.integers(1, 4))} X{_text(r, 4)} Y{_text(r, 4)} I{_text(r, 4)} J0 G90"
                       .replace(" G90", "\nG90"))  # fmt: skip
    lines += ["M5 M9", "M30", "%"]
    return "\n".join(f"N{10 * i} {line}" if line not in ("%",) else line for i, line in enumerate(lines)) + "\n"


def _plotter_program(rng: np.random.Generator) -> str:
    lines = ["g21 g90", "F1500", "g0 z5"]
    for _ in range(int(rng.integers(1, 6))):
        x, y = rng.uniform(0, 60, 2)
        lines += [f"g0x{_text(x)}y{_text(y)}", "m3 s90", "g1z0"]
        for _ in range(int(rng.integers(1, 10))):
            dx, dy = rng.uniform(-9, 9, 2)
            x, y = round(x + dx, 3), round(y + dy, 3)
            r = round(float(np.hypot(dx, dy)) * rng.uniform(0.52, 2) * (1 if rng.random() < 0.7 else -1), 3)
            line = (
                f"g1x{_text(x)}y{_text(y)}"
                if rng.random() < 0.5
                else f"g{rng.integers(2, 4)} x{_text(x)} y{_text(y)} r{_text(r)}"
            )
            lines.append(line)
        lines += ["m5", "g0z5 (pen up)"]
    return "\n".join(lines) + "\n"


def _sender_program(rng: np.random.Generator) -> str:
    parts = ["G21 G90 G54", "G0 X0 Y0 Z0", "F800"]
    for _ in range(int(rng.integers(5, 25))):
        how = int(rng.integers(8))
        x, y, z = (float(round(v, 3)) for v in rng.uniform(-20, 20, 3))
        parts.append((
            f"G1 X{x} Y{y}", f"G91\nG1 X{x} Z{z}\nG90", f"G92 X{x} Y{y}", f"G52 X{x} Z{z}",
            f"G10 L2 P{rng.integers(0, 7)} X{x} Y{y} Z{z}", f"G10 L20 P{rng.integers(0, 7)} X{x} Z{z}",
            f"G{rng.integers(54, 60)} G0 X{x}", f"G53 G1 X{x} Y{y}",
        )[how])  # fmt: skip
    parts += ["G1 X1 Y2 Z3", "X4"]
    lines = "\n".join(parts).splitlines()
    if rng.random() < 0.5:  # numbered, with checksums
        for i, line in enumerate(lines):
            text, check = f"N{i + 1} {line}", 0
            for letter in text:
                check ^= ord(letter)
            lines[i] = f"{text}*{check}"
    return "\n".join(lines) + "\n"


def random_drawing(seed: int) -> str:
    """An SVG drawing."""
    rng = np.random.default_rng(seed)
    unit, k = (("mm", 1.0), ("cm", 0.1), ("in", 1 / 25.4), ("px", 96 / 25.4), ("", 96 / 25.4))[seed % 5]
    x, y = rng.uniform(-20, 20, 2).round(2)
    body = "\n".join(_nested_groups(rng, int(rng.integers(0, 4))) for _ in range(int(rng.integers(1, 5))))
    return (
        f'<?xml version="1.0"?>\n<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        f'viewBox="{x} {y} 100 80" width="{100 * k:.9f}{unit}" height="{80 * k:.9f}{unit}">\n'
        f'<defs><path id="a" d="M0 0l3 4h2"/></defs>\n{body}\n</svg>\n'
    )


def _nested_groups(rng: np.random.Generator, deep: int) -> str:
    if deep == 0:
        return _random_shape(rng)
    a, b = rng.uniform(-5, 5, 2).round(3)
    how = (
        f"translate({a},{b})", f"translate({a})", f"rotate({10 * a})", f"rotate({10 * a} {b} {a})",
        f"scale({1 + a / 9:.4f})", f"scale({1 + a / 9:.4f} {1 + b / 9:.4f})",
        f"skewX({4 * a})", f"matrix(1 {a / 20:.4f} {b / 20:.4f} 1 {a} {b})",
    )[int(rng.integers(8))]  # fmt: skip
    return f'<g transform="{how}" stroke="black">{_nested_groups(rng, deep - 1)}{_random_shape(rng)}</g>'


def _random_shape(rng: np.random.Generator) -> str:
    x, y, u, v = rng.uniform(1, 40, 4).round(3)
    r, s = rng.uniform(1, 12, 2).round(3)
    kind = int(rng.integers(9))
    if kind < 4:
        return f'<path fill="none" d="{_path_data(rng)}"/>'
    return (
        f'<line x1="{x}" y1="{y}" x2="{u}" y2="{v}"/>', f'<rect x="{x}" y="{y}" width="{r}" height="{s}"/>',
        f'<circle cx="{x}" cy="{y}" r="{r}"/>', f'<ellipse cx="{x}" cy="{y}" rx="{r}" ry="{s}"/>',
        f'<polygon points="{x},{y} {u},{v} {x + r:.3f} {v}"/><use xlink:href="#a" x="{u}" y="{y}"/>',
    )[kind - 4]  # fmt: skip


def _path_data(rng: np.random.Generator) -> str:
    """Path data; numbers run together as drawing programs write them."""
    path = "M{:g} {:g}".format(*rng.uniform(10, 40, 2).round(2))
    for _ in range(int(rng.integers(1, 9))):
        letter = str(rng.choice(list("LlHhVvCcSsQqTtAaZzm")))
        n = {"H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "Z": 0}.get(letter.upper(), 2)
        v = rng.uniform(-15, 15, n).round(2) + (25 if letter.isupper() else 0)
        text = " ".join(f"{a:g}" for a in v)
        if letter in "Aa":
            rx, ry = rng.uniform(2, 20, 2).round(2)
            text = f"{rx:g} {ry:g} {rng.integers(-90, 90)} {rng.integers(2)} {rng.integers(2)} {text}"
        path += letter + (text.replace(" -", "-") if rng.random() < 0.5 and letter not in "Aa" else text)
        if letter == "m":
            path += " l3 1"
    return path

"""The page as one HTML file without a server: its modules are inlined, and the arm's own solver answers."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armkin.export.js.es_module import module_text
from armkin.teach.arm_description import scene_json
from armkin.teach.browser_solver import solver_json
from armkin.teach.plan_samples import playback_json
from armkin.teach.reach_slice import reach_slice

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.plan.path_plan import PathPlan

_STATIC = Path(__file__).parent / "static"
_LOCAL = Path(__file__).parent / "local" / "local.js"
_IMPORT = re.compile(r'((?:from|import)\s*\(?\s*)"([./][^"]+)"')


def arm_html(
    arm: Arm, task_name: str | None = None, plan: PathPlan | None = None, meshes: dict[str, Any] | None = None
) -> str:
    """The arm in one HTML file: every branch as the pose is dragged; plan: of a path, which the page plays.

    meshes: what the bodies look like, see `armkin.teach.urdf_meshes.meshes_json`.

    Raises UsageError if the task does not fit the arm, or if its class has no form in JavaScript.
    """
    modules = {f"js/{path.name}": path.read_text(encoding="utf-8") for path in sorted((_STATIC / "js").glob("*.js"))}
    modules["js/server.js"] = _LOCAL.read_text(encoding="utf-8").replace('"../static/js/', '"./')
    for path in sorted((_STATIC / "vendor" / "three").glob("*.js")):
        modules[f"vendor/three/{path.name}"] = path.read_text(encoding="utf-8")
    modules |= {"arm.js": module_text(arm, task_name), "data.js": _page_json(arm, task_name, plan, meshes)}
    imports = {f"armkin/{name}": _data_url(_by_name(_strip_comments(text), name)) for name, text in modules.items()}
    imports["three"] = imports.pop("armkin/vendor/three/three.module.min.js")
    import_map = re.sub("<(?=[/!]|script)", r"\\u003c", json.dumps({"imports": imports}), flags=re.IGNORECASE)
    main = 'import "armkin/js/main.js";'
    style = (_STATIC / "page.css").read_text(encoding="utf-8")
    scripts = f"{_csp_hash(import_map)} {_csp_hash(main)} data:"
    policy = f"default-src 'none'; script-src {scripts}; style-src {_csp_hash(style)}; img-src data:"
    text = (_STATIC / "index.html").read_text(encoding="utf-8")
    text = re.sub(r'<link rel="(?:modulepreload|stylesheet)"[^>]*>\n', "", text)
    text = re.sub(r"<script .*?</script>\n", "", text, flags=re.DOTALL)
    head = (
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n<style>{style}</style>\n'
        f'<script type="importmap">{import_map}</script>\n<script type="module">{main}</script>\n</head>'
    )
    return text.replace("</head>", head, 1)


def _strip_comments(text: str) -> str:
    """A module without whole-line comments and indentation, which is safe as no string spans lines."""
    text = re.sub(r"^[ \t]*/\*\*(?:(?!\*/).)*\*/[ \t]*$", "", text, flags=re.DOTALL | re.MULTILINE)
    lines = (line.strip() for line in text.splitlines())
    return "\n".join(line for line in lines if line and not line.startswith("//"))


def _by_name(text: str, name: str) -> str:
    """Replace a module's relative imports by names of the import map, since a `data:` URL has no folder."""
    folder = Path("/") / Path(name).parent

    def map_import(match: re.Match[str]) -> str:
        path = match[2] if match[2].startswith("/") else str((folder / match[2]).as_posix())
        return f'{match[1]}"armkin{path}"'

    return _IMPORT.sub(map_import, text)


def _data_url(text: str) -> str:
    """A module as a `data:` URL, with only those characters escaped that would end it."""
    for letter in ("%", "#", "\r", "\n", "\t"):
        text = text.replace(letter, f"%{ord(letter):02X}")
    return f"data:text/javascript;charset=utf-8,{text}"


def _csp_hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _page_json(arm: Arm, task_name: str | None, plan: PathPlan | None, meshes: dict[str, Any] | None) -> str:
    """The data of the page besides the solver: scene, labels and plan, as JavaScript constants."""
    solver = solver_json(arm, task_name)
    scene = {
        **scene_json(arm),
        "robot_file": Path(arm.path).name if arm.path else arm.name,
        "lock": solver["held"] or None,
    }
    values = {
        "arm": scene | {"locks": False, "meshes": meshes},
        "solver": solver,
        "plan": None if plan is None else playback_json(arm, plan),
        "slice": None if task_name else reach_slice(arm),  # the slice is that of the arm's own task
    }
    return "".join(f"export const {name} = {_json_text(value)};\n" for name, value in values.items())


def _json_text(value: Any) -> str:
    return json.dumps(value, allow_nan=False).replace("<", "\\u003c")

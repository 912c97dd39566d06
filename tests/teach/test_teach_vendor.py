"""three.js is vendored byte for byte: these files of the npm package three 0.185.0."""

from __future__ import annotations

import hashlib

from armkin.teach.server import STATIC

VERSION = "0.185.0"
FILES = {
    "LICENSE": "8b378ebe60e2fe500158cb0ac71cb5e8b7d92953c2abcc63a0eb90499653b5bc",
    "OrbitControls.js": "faabb4e8dfd9235ee4a9fd7c9a3d75f90f1689dbd4944bd6fd32117dacec5f93",
    "TransformControls.js": "151befe25bb0d68626f9a6b033625b7b0cf6848e39ba71623b7bed8e3df565d6",
    "three.core.min.js": "0e9dd2793e01d0d9eb4f2ab00b4ffcdd4488275ebebee5c31fa8d347bc29f0bf",
    "three.module.min.js": "86bcee248b64f44bcfc23c331ae74619061957d59cab040171dcb6fb5900beb6",
}
VENDOR = STATIC / "vendor" / "three"


def test_every_vendored_byte_is_the_package_s() -> None:
    hash_of = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in VENDOR.iterdir()}
    assert hash_of == FILES


def test_the_version_is_the_one_that_is_named() -> None:
    assert f'"{VERSION.split(".")[1]}"' in (VENDOR / "three.core.min.js").read_text()  # three's REVISION
    assert "The MIT License" in (VENDOR / "LICENSE").read_text()


def test_every_module_is_asked_for_at_once() -> None:
    """A module that is found only by reading another one costs a request's time."""
    page = (STATIC / "index.html").read_text()
    for path in sorted(STATIC.rglob("*.js")):
        name = "/" + path.relative_to(STATIC).as_posix()
        if path.stem not in ("main", "types"):  # main is the script itself, types are for the editor
            assert f'rel="modulepreload" nonce="{{{{nonce}}}}" href="{name}"' in page

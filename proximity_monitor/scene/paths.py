"""Where files are: model paths in their three spellings, and the bundled scenes."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from proximity_monitor.scene.report import SceneError

_PACKAGE = "proximity_monitor"
_SCHEME = "package://"
_HERE = Path(__file__).resolve()
_BUNDLED = _HERE.parent / "bundled"


def bundled(name: str) -> Path:
    """Return the scene file of a scene that comes with the package.

    Raises:
        SceneError: there is none of that name; the message lists those that exist.
    """
    names = sorted(path.parent.name for path in _BUNDLED.glob("*/scene.yaml"))
    if name not in names:
        raise SceneError(f"no bundled scene {name!r}; there is {', '.join(names) or 'none'}")
    return _BUNDLED / name / "scene.yaml"


def model_path(text: str, folder: Path) -> Path:
    """Resolve a model path of a scene file.

    Args:
        text: relative to `folder`, absolute, or ``package://PACKAGE/PATH``.
        folder: where the scene file is.

    Returns:
        The absolute path of an existing file.

    Raises:
        SceneError: says where the file was looked for.
    """
    if text.startswith(_SCHEME):
        package, _, rest = text.removeprefix(_SCHEME).partition("/")
        if not package or not rest:
            raise SceneError(f"must read package://PACKAGE/PATH (got {text!r})")
        candidates = [share / rest for share in _shares(package)]
        if not candidates:
            raise SceneError(
                f"package '{package}' is in no prefix of AMENT_PREFIX_PATH; "
                "source the workspace that has it"
            )
    else:
        candidates = [folder.absolute() / text]
    for path in candidates:
        # os.path answers False where pathlib would raise, as for names that are too long.
        if os.path.isfile(path):
            return path
    raise SceneError(f"no such file: {', nor '.join(map(str, candidates))}")


def _shares(package: str) -> list[Path]:
    """List the share folders of a package, in the order in which ROS 2 looks for them."""
    prefixes = [Path(each) for each in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if each]
    shares = [prefix / "share" / package for prefix in prefixes]
    if package == _PACKAGE:
        # Without a sourced workspace: pip's data files, and the package as imported, whose parent
        # folder is laid out like the share folder if it is a checkout.
        shares += [Path(sys.prefix) / "share" / package, _HERE.parents[1]]
        if (_HERE.parents[2] / "package.xml").is_file():
            shares.append(_HERE.parents[2])
    return [share.absolute() for share in shares if os.path.isdir(share)]

"""Finds files: model paths in their three spellings, and the bundled scenes."""

from __future__ import annotations

import os
import sys
from importlib import metadata
from pathlib import Path

from proximity_monitor.scene.report import SceneError

_PACKAGE = "proximity_monitor"
_SCHEME = "package://"
_HERE = Path(__file__).resolve()
_BUNDLED = _HERE.parent / "bundled"
_DATA_ON_PYPI = ("example-robot-data",)
"""ROS packages that hold only data and that the extra `robots` installs from PyPI."""
WITH_ROBOTS = "in the checkout: pip install '.[robots]'"
"""How to install the packages that robot descriptions and meshes may need."""


def bundled(name: str) -> Path:
    """Return the scene file of a scene that comes with the package.

    Raises:
        SceneError: no bundled scene has that name; the message lists the existing names.
    """
    names = bundled_names()
    if name not in names:
        raise SceneError(f"no bundled scene {name!r}; known: {', '.join(names) or 'none'}")
    return _BUNDLED / name / "scene.yaml"


def bundled_names() -> list[str]:
    """Return the names of the scenes that come with the package, sorted."""
    return sorted(path.parent.name for path in _BUNDLED.glob("*/scene.yaml"))


def model_path(text: str, folder: Path, *, or_folder: bool = False) -> Path:
    """Resolve the path of a model, or of another file that a scene file names.

    Args:
        text: relative to `folder`, absolute, or ``package://PACKAGE/PATH``.
        folder: where the scene file is.
        or_folder: whether a folder is accepted as well.

    Returns:
        The absolute path of an existing file or folder.

    Raises:
        SceneError: says where the file was looked for.
    """
    if text.startswith(_SCHEME):
        package, _, rest = text.removeprefix(_SCHEME).partition("/")
        if not package or not rest:
            raise SceneError(f"must have the form package://PACKAGE/PATH (got {text!r})")
        candidates = [share / rest for share in _shares(package)]
        if not candidates:
            raise SceneError(
                f"package '{package}' was not found in AMENT_PREFIX_PATH; "
                "source the workspace that contains it"
                + (f", or, {WITH_ROBOTS}" if package in _DATA_ON_PYPI else "")
            )
    else:
        candidates = [folder.absolute() / text]
    for path in candidates:
        # If a name is too long, os.path returns False, whereas pathlib raises an error.
        if os.path.isfile(path) or (or_folder and os.path.isdir(path)):
            return path
    raise SceneError(f"no such file: {' or '.join(map(str, candidates))}")


def mesh_path(text: str, urdf: Path) -> Path:
    """Resolve the path of a mesh that a robot description names.

    Args:
        text: ``package://PACKAGE/PATH``, ``file:///PATH``, absolute, or relative to the
            description's folder. PACKAGE is looked for among the folders above the description
            first, then as in `model_path`. PATH must stay inside the package.
        urdf: the description, absolute.

    Returns:
        The absolute path of an existing file.

    Raises:
        SceneError: says where the file was looked for.
    """
    if text.startswith("file://"):
        text = text.removeprefix("file://")
        if not text.startswith("/"):
            raise SceneError(
                f"must have the form file:///PATH, with three slashes (got 'file://{text}')"
            )
    elif text.startswith(_SCHEME):
        package, _, rest = text.removeprefix(_SCHEME).partition("/")
        if os.path.normpath(rest).startswith(("..", "/")):
            raise SceneError(f"'{text}' is outside its package; name a file inside it")
        for folder in urdf.parents:
            if package and folder.name == package and os.path.isfile(folder / rest):
                return folder / rest
    elif "://" in text:
        raise SceneError(f"'{text}' must begin with package:// or file://, or be a plain path")
    return model_path(text, urdf.parent)


def _installed_by_pip(package: str) -> list[Path]:
    """Return the share folders of a package that pip installed, wherever they are in its tree."""
    try:
        files = metadata.files(package) or []
    except metadata.PackageNotFoundError:
        return []
    wanted = ("share", package, "package.xml")
    return [Path(file.locate()).parent for file in files if file.parts[-3:] == wanted]


def _shares(package: str) -> list[Path]:
    """List the share folders of a package, in the order in which ROS 2 looks for them."""
    prefixes = [Path(each) for each in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if each]
    shares = [prefix / "share" / package for prefix in prefixes]
    if package == _PACKAGE:
        # If no workspace is sourced: pip's data files, and the imported package. In a checkout,
        # the package's parent folder is laid out like the share folder.
        shares += [Path(sys.prefix) / "share" / package, _HERE.parents[1]]
        if (_HERE.parents[2] / "package.xml").is_file():
            shares.append(_HERE.parents[2])
    elif package in _DATA_ON_PYPI:
        shares += _installed_by_pip(package)
    return [share.absolute() for share in shares if os.path.isdir(share)]

"""The dependencies between the rooms, read from the imports: they all point in one direction.

A room is a folder or a module of the package with rules of its own about imports.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

NAME = "proximity_monitor"
PACKAGE = Path(__file__).resolve().parents[1] / NAME
MAX_LINES = 400

# `KNOWS` maps each room to the rooms that it may import. A new room must be added to it first.
# The floors are the rooms of the kernels, the lowest first: each may import itself and those below.
KERNELS = "engine/kernels"
_FLOORS = [
    "base", "tree", "bounds", "elements", "inside", "surface", "revolution", "search", "pairs",
    "assembly",
]  # fmt: skip
_KERNEL_ROOMS = {
    f"{KERNELS}/{room}": {f"{KERNELS}/{below}" for below in _FLOORS[: i + 1]}
    for i, room in enumerate(_FLOORS)
}
_SHARED = {"engine/arguments", "engine/poses"}
_FLOOR = {*_KERNEL_ROOMS, *_SHARED}
_PROTOCOL = "engine/models/model"  # what every kind of model does; outer rooms may know it
_MODELS = {*_FLOOR, "engine/models", _PROTOCOL}
_QUESTIONS = {*_MODELS, "engine/questions"}
_ASSEMBLY = {*_QUESTIONS, "engine/assembly"}
_ENGINE = {*_ASSEMBLY, "engine/files", "engine/compiling", "engine"}
# The rooms of the engine that rooms outside it may know, as each needs them: never a kernel.
_PUBLIC = {"engine", "engine/compiling", _PROTOCOL}
_WATCHING = {*_PUBLIC, "engine/poses", "engine/assembly"}
KNOWS = {
    KERNELS: set(),
    **_KERNEL_ROOMS,
    "engine/arguments": set(),
    "engine/poses": _FLOOR,
    "engine/compiling": _FLOOR,
    "engine/ahead": _FLOOR,
    "engine/models": _MODELS,
    _PROTOCOL: _MODELS,
    "engine/files": {"engine/files", "engine/models", _PROTOCOL},
    "engine/questions": _QUESTIONS,
    "engine/assembly": _ASSEMBLY,
    "engine": _ENGINE,
    "scene": {"scene", *_WATCHING},
    "motion": {"motion", "scene", *_PUBLIC},
    "study": {"study", "motion", "scene", "ending", *_ENGINE} - set(_KERNEL_ROOMS),
    "cdr": set(),  # reads and writes messages as bytes
    "ending": set(),  # ends processes
    "ros": {"ros", "motion", "scene", "cdr", "ending", *_PUBLIC},
    "display": {"display", "scene", "cdr", "ending", *_PUBLIC},
    "__main__": {"display", "ros", "motion", "scene", "ending", *_PUBLIC},
    "": set(),  # the package's own __init__.py, which everybody may know
}
# Third-party packages that the engine may import; its file readers may import no compiler. Other
# rooms may import any package but compilers, and ROS only if they are in `ROS_ROOMS`.
# llvmlite is numba's own compiler: kernels use it for operations that numba has no name for.
# Other rooms compile with engine/compiling.py, which finds a place to keep the code.
ENGINE_NEEDS = {"numpy", "numba"}
KERNELS_NEED = {"llvmlite"}
FILES_NEED = {"OCP"}  # an extra: imported when a STEP file is read
COMPILERS = {"numba", "llvmlite"}
ROS_ROOMS = {"ros", "display"}
# Rooms that use models by their protocol alone, so that a new kind of model changes none of them.
KIND_FREE = {"scene", "motion", "ros", "display", "__main__"}
OF_KINDS = {"TriangleMesh", "Patch", "Curve", "ParametricSurface"}
INSIDE_MODELS = {"vertices", "faces", "nets", "swept_radius", "core_radius", "_hierarchy"}
ROS_PACKAGES = {
    "rclpy",
    "builtin_interfaces",
    "ament_index_python",
    "launch",
    "launch_ros",
    "tf2_ros",
}
ROS_SUFFIXES = ("_msgs", "_srvs", "_interfaces")


def room_of(path: tuple[str, ...]) -> str:
    """Return the room of a module, given by its path within the package without suffix."""
    for length in range(len(path), 0, -1):
        room = "/".join(path[:length])
        if room in KNOWS:
            return room
    return path[0] if path else ""


def is_ros(name: str) -> bool:
    return name in ROS_PACKAGES or name.endswith(ROS_SUFFIXES) or name.startswith("rosidl_")


def imports(tree: ast.Module, package: tuple[str, ...]) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Yield line and path of everything imported; `package` is the package that one dot means."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, tuple(alias.name.split("."))
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            base += tuple(node.module.split(".")) if node.module else ()
            for alias in node.names:
                yield node.lineno, (*base, alias.name)


def target_room(path: tuple[str, ...], root: Path) -> str:
    """Return the room of an import: of a folder, of a module, or of a name in one of them."""
    inner = path[1:]
    while inner and not (
        root.joinpath(*inner).is_dir() or root.joinpath(*inner).with_suffix(".py").is_file()
    ):
        inner = inner[:-1]
    return room_of(inner)


def broken_rules(room: str, path: tuple[str, ...], root: Path) -> Iterator[str]:
    """Yield what is wrong with one import."""
    top = path[0]
    if top == root.name:
        target = target_room(path, root)
        if target and target not in KNOWS[room]:
            yield f"must not know {target}"
    elif is_ros(top):
        if room not in ROS_ROOMS:
            yield f"must not import {top}"
    elif room.startswith("engine"):
        allowed = ENGINE_NEEDS | sys.stdlib_module_names
        allowed |= KERNELS_NEED if room.startswith(KERNELS) else set()
        if room == "engine/files":
            allowed = allowed - COMPILERS | FILES_NEED
        if top not in allowed:
            yield f"must not import {top}"
    elif top in COMPILERS:
        yield f"must not import {top}"


def names_of_kinds(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield line and name of each use of a kind's class, or of what only some kinds have."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            read = isinstance(node.ctx, ast.Load) and node.attr in INSIDE_MODELS
            if read or node.attr in OF_KINDS:
                yield node.lineno, node.attr
        elif isinstance(node, ast.Name) and node.id in OF_KINDS:
            yield node.lineno, node.id
        elif isinstance(node, ast.ImportFrom):
            yield from ((node.lineno, a.name) for a in node.names if a.name in OF_KINDS)


def violations(root: Path) -> list[str]:
    """Return everything in a package folder that breaks a rule, as ``file:line: room what``."""
    found = []
    for file in sorted(root.rglob("*.py")):
        where = file.relative_to(root).as_posix()
        inner = file.relative_to(root).with_suffix("").parts
        room = room_of(inner[:-1] if inner[-1] == "__init__" else inner)
        text = file.read_text(encoding="utf-8")
        if text.count("\n") > MAX_LINES:
            found.append(f"{where}:{MAX_LINES}: longer than {MAX_LINES} lines")
        if room not in KNOWS:
            found.append(f"{where}:1: unknown room {room}")
            continue
        tree = ast.parse(text)
        if room in KIND_FREE:
            for line, name in names_of_kinds(tree):
                found.append(f"{where}:{line}: {room} must not know a model's {name}")
        for line, path in imports(tree, (root.name, *inner[:-1])):
            for rule in broken_rules(room, path, root):
                found.append(f"{where}:{line}: {room} {rule}")
    return list(dict.fromkeys(found))


def test_the_package_keeps_the_rules():
    assert violations(PACKAGE) == []


def test_every_room_is_a_package_that_gets_installed():
    missing = [
        str(folder.relative_to(PACKAGE))
        for folder in {file.parent for file in PACKAGE.rglob("*.py")}
        if not (folder / "__init__.py").is_file()
    ]
    assert missing == []


BROKEN = {
    "kernels know the engine": (
        "engine/kernels/base/a.py",
        "from proximity_monitor.engine import models",
        "must not know engine/models",
    ),
    "kernels climb up": (
        "engine/kernels/base/a.py",
        "from ... import models",
        "must not know engine/models",
    ),
    "kernels climb a floor": (
        "engine/kernels/base/a.py",
        "from ..tree.b import X",
        "must not know engine/kernels/tree",
    ),
    "models ask questions": (
        "engine/models/mesh.py",
        "from ..questions.pair import Pair",
        "must not know engine/questions",
    ),
    "questions know many pairs": (
        "engine/questions/pair.py",
        "from ..assembly.batch import distances",
        "must not know engine/assembly",
    ),
    "a tool knows a room": (
        "engine/arguments.py",
        "from .models.mesh import X",
        "must not know engine/models",
    ),
    "kernels use trimesh": (
        "engine/kernels/base/a.py",
        "import trimesh",
        "must not import trimesh",
    ),
    "the engine uses trimesh": (
        "engine/files/load.py",
        "import trimesh.util",
        "must not import trimesh",
    ),
    "a reader asks": (
        "engine/files/a.py",
        "from ..questions.pair import Pair",
        "must not know engine/questions",
    ),
    "a reader compiles": ("engine/files/a.py", "import numba", "must not import numba"),
    "engine uses yaml": ("engine/models/mesh.py", "import yaml", "must not import yaml"),
    "engine uses ROS": (
        "engine/models/mesh.py",
        "from geometry_msgs.msg import Pose",
        "must not import geometry_msgs",
    ),
    "engine knows scene": (
        "engine/models/mesh.py",
        "from proximity_monitor import scene",
        "must not know scene",
    ),
    "engine knows scene, relatively": (
        "engine/models/mesh.py",
        "from ...scene.file import x",
        "must not know scene",
    ),
    "within a function": (
        "engine/models/mesh.py",
        "def f():\n    import yaml",
        ":2: engine/models must not import yaml",
    ),
    "scene knows kernels": (
        "scene/file.py",
        "from proximity_monitor.engine.kernels.base.a import f",
        "must not know engine/kernels",
    ),
    "scene knows motion": (
        "scene/file.py",
        "import proximity_monitor.motion",
        "must not know motion",
    ),
    "scene uses rclpy": ("scene/file.py", "import rclpy.node", "must not import rclpy"),
    "motion knows ros": (
        "motion/m.py",
        "from proximity_monitor.ros.node import main",
        "must not know ros",
    ),
    "motion compiles by itself": (
        "motion/m.py",
        "from numba import njit",
        "must not import numba",
    ),
    "ros knows kernels": (
        "ros/node.py",
        "from proximity_monitor.engine import kernels",
        "must not know engine/kernels",
    ),
    "scene names a kind of model": (
        "scene/file.py",
        "from proximity_monitor import engine\ndef f(model: engine.TriangleMesh): pass",
        ":2: scene must not know a model's TriangleMesh",
    ),
    "ros looks into a model": (
        "ros/node.py",
        "def corners(model): return model.vertices[0]",
        "must not know a model's vertices",
    ),
    "motion knows models by their room": (
        "motion/m.py",
        "from proximity_monitor.engine.models.tree import places",
        "must not know engine/models",
    ),
    "study knows ros": (
        "study/accuracy/a.py",
        "from proximity_monitor.ros import table",
        "must not know ros",
    ),
    "study knows kernels": (
        "study/accuracy/a.py",
        "from ...engine.kernels import volumes",
        "must not know engine/kernels",
    ),
    "study uses ROS": (
        "study/scenes.py",
        "import rosbag2_py, std_msgs",
        "must not import std_msgs",
    ),
    "motion knows study": ("motion/m.py", "from ..study import scenes", "must not know study"),
    "display knows ros": (
        "display/page.py",
        "from proximity_monitor import ros",
        "must not know ros",
    ),
    "the root uses ROS": ("__init__.py", "import rclpy", "must not import rclpy"),
    "ros knows the command line": (
        "ros/node.py",
        "from proximity_monitor.__main__ import main",
        "must not know",
    ),
    "a new room": ("attic/a.py", "", "unknown room attic"),
    "a long file": ("scene/file.py", "\n" * 401, "longer than 400 lines"),
}
SOUND = {
    "__init__.py": "",
    "__main__.py": "from proximity_monitor.ros import node",
    "engine/__init__.py": "from .models.mesh import X\nfrom .kernels.base import a",
    "engine/models/mesh.py": "import numba\nimport numpy as np\nimport math\n\nX = 1",
    "engine/models/tree.py": "places = 1\nx = model.vertices",
    "engine/models/__init__.py": "",
    "engine/questions/pair.py": "",
    "engine/assembly/batch.py": "from ..questions.pair import X",
    "engine/files/load.py": "from ..models.mesh import X\nfrom .a import X",
    "engine/files/__init__.py": "",
    "engine/files/a.py": "import json\nimport numpy as np\nfrom .b import y",
    "engine/files/b.py": "",
    "engine/kernels/__init__.py": "",
    "engine/kernels/base/rounding.py": "EPS = 1e-16",
    "engine/kernels/base/a.py": "from .rounding import EPS\nfrom . import b\nfrom .b import g",
    "engine/kernels/base/b.py": "from proximity_monitor.engine.kernels.base import a",
    "engine/kernels/tree/b.py": "from ..base.a import g",
    "scene/__init__.py": "",
    "scene/file.py": "import yaml\nfrom proximity_monitor import engine\nfrom ..engine import X",
    "motion/__init__.py": "",
    "motion/m.py": "from ..engine import X\nfrom proximity_monitor.scene.file import Scene",
    "study/__init__.py": "",
    "study/scenes.py": "from proximity_monitor import motion\nfrom ..scene import file",
    "study/accuracy/a.py": "import matplotlib\nfrom ..scenes import X\nfrom ...engine import Y",
    "ros/__init__.py": "",
    "ros/node.py": "import rclpy, std_msgs.msg\nfrom proximity_monitor import __version__",
    "display/__init__.py": "",
    "display/page.py": "import viser\na.faces = 1\nfrom proximity_monitor.scene.file import Scene",
}


@pytest.fixture
def house(tmp_path: Path) -> Path:
    """A package that keeps the rules."""
    root = tmp_path / NAME
    for name, text in SOUND.items():
        file = root / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return root


def test_a_sound_house_is_found_sound(house):
    assert violations(house) == []


@pytest.mark.parametrize("file, text, expected", BROKEN.values(), ids=BROKEN)
def test_a_broken_rule_is_found(house, file, text, expected):
    (house / file).parent.mkdir(parents=True, exist_ok=True)
    (house / file).write_text(text)
    (found,) = violations(house)
    assert found.startswith(f"{file}:")
    assert expected in found


@pytest.mark.parametrize("room", ["engine", "scene", "motion", "study.accuracy.run"])
def test_the_library_imports_without_ros(room):
    code = (
        "import importlib, sys\n"
        f"importlib.import_module('{NAME}.{room}')\n"
        "print(*{name.partition('.')[0] for name in sys.modules})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert [name for name in done.stdout.split() if is_ros(name)] == []

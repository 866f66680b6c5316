"""One tree, two ways to install it: what colcon and pip read agrees with what is in the package."""

from __future__ import annotations

import ast
import os
import re
import sys
from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree

import pytest

import proximity_monitor

ROOT = Path(__file__).resolve().parents[1]
NAME = "proximity_monitor"
MANIFEST = ElementTree.parse(ROOT / "package.xml").getroot()

# rosdep's keys of packages that are not ROS packages; the key of a ROS package is its name.
ROSDEP = {
    "jsonschema": "python3-jsonschema",
    "matplotlib": "python3-matplotlib",
    "numba": "python3-numba",
    "numpy": "python3-numpy",
    "rich": "python3-rich",
    "yaml": "python3-yaml",
}
NO_ROSDEP_KEY = {"viser", "rosbags", "OCP"}
COMES_ALONG = {"llvmlite", "msgspec", "websockets"}  # with numba and with viser
STARTED_NOT_IMPORTED = {"rviz2"}


def setup_argument(name: str) -> str:
    for node in ast.walk(ast.parse((ROOT / "setup.py").read_text())):
        if isinstance(node, ast.keyword) and node.arg == name:
            return ast.literal_eval(node.value)
    raise KeyError(name)


def test_versions_agree():
    version = MANIFEST.findtext("version")
    assert setup_argument("version") == version
    assert proximity_monitor.__version__ == version
    headings = re.findall(
        r"^(\d+\.\d+\.\d+) \(.+\)\n-+$", (ROOT / "CHANGELOG.rst").read_text(), re.M
    )
    assert headings[0] == version


def test_the_manifest_makes_colcon_see_a_ros_package():
    assert MANIFEST.get("format") == "3"
    assert MANIFEST.findtext("name") == NAME
    assert MANIFEST.findtext("export/build_type") == "ament_python"
    assert MANIFEST.findtext("license") == setup_argument("license") == "Apache-2.0"
    # If catkin_pkg refuses the address, colcon silently takes this for a plain Python package.
    address = MANIFEST.find("maintainer").get("email")
    assert re.fullmatch(r"[-\w.+]+@[-\w]+(\.[-\w]+)+", address)
    assert setup_argument("maintainer_email") == address


def test_every_import_has_its_dependency_and_none_is_idle():
    imported = set()
    files = [
        *(ROOT / NAME).rglob("*.py"),
        *(ROOT / "launch").iterdir(),
        *(ROOT / "scripts").iterdir(),
    ]
    for file in files:
        if not file.is_file():
            continue
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                imported |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                imported.add(node.module.partition(".")[0])
    imported -= sys.stdlib_module_names | NO_ROSDEP_KEY | COMES_ALONG | {NAME}
    declared = {each.text for each in MANIFEST.iter("exec_depend")}
    assert {ROSDEP.get(name, name) for name in imported} == declared - STARTED_NOT_IMPORTED


@pytest.mark.parametrize("name", ["display", "node", "player"])
def test_launchers_can_be_executed(name):
    launcher = ROOT / "scripts" / name
    assert os.access(launcher, os.X_OK)
    assert launcher.read_text().startswith("#!/usr/bin/env python3\n")


@pytest.mark.parametrize("name", ["monitor", "demo"])
def test_launch_files_take_the_usual_arguments(name):
    tree = ast.parse((ROOT / "launch" / f"{name}.launch.py").read_text())
    declared = {
        ast.literal_eval(node.args[0])
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "DeclareLaunchArgument"
    }
    assert declared == {"scene", "params_file", "use_sim_time", "rviz"}


def calls(name, function):
    """Return the calls of a function in a launch file, in the order of their lines."""
    tree = ast.parse((ROOT / "launch" / f"{name}.launch.py").read_text())
    found = [n for n in ast.walk(tree) if isinstance(n, ast.Call)]
    found.sort(key=lambda call: call.lineno)
    return [call for call in found if getattr(call.func, "id", "") == function]


@pytest.mark.parametrize(("name", "count"), [("monitor", 2), ("demo", 1)])
def test_the_end_of_what_launch_started_ends_the_rest(name, count):
    started = calls(name, "Node")
    assert len(started) == count
    for call in started:
        (on_exit,) = [each.value for each in call.keywords if each.arg == "on_exit"]
        assert on_exit.func.id == "Shutdown"


def test_launch_looks_for_rviz_before_it_starts_anything():
    """An error in a launch file ends launch, but not the processes that it started before."""
    functions = [call.keywords[0].value.id for call in calls("monitor", "OpaqueFunction")]
    assert functions == ["viewer", "monitor"]
    included, node = calls("demo", "IncludeLaunchDescription") + calls("demo", "Node")
    assert included.lineno < node.lineno
    source = (ROOT / "launch" / "monitor.launch.py").read_text()
    viewer = source[source.index("def viewer") :]
    assert viewer.index("get_package_prefix(") < viewer.index("Node(")


@pytest.fixture
def prefix() -> Path:
    """The prefix under which colcon or pip has installed the package."""
    for text in (*os.environ.get("AMENT_PREFIX_PATH", "").split(":"), sys.prefix):
        path = Path(text)
        if text and (path / "share/ament_index/resource_index/packages" / NAME).is_file():
            return path
    pytest.skip("the package is imported from a checkout; `make test` installs it")


def test_the_prefix_has_what_ros2_run_and_launch_look_for(prefix):
    for name in ("node", "player"):
        assert os.access(prefix / "lib" / NAME / name, os.X_OK)
    share = prefix / "share" / NAME
    for folder in ("config", "launch"):
        wanted = sorted(file.name for file in (ROOT / folder).iterdir() if file.is_file())
        assert sorted(file.name for file in (share / folder).iterdir() if file.is_file()) == wanted
    assert (share / "package.xml").read_text() == (ROOT / "package.xml").read_text()


def test_no_script_takes_the_name_of_another_program(prefix):
    scripts = metadata.distribution(NAME).entry_points.select(group="console_scripts")
    assert [script.name for script in scripts] == [NAME]


def test_package_data_is_installed_beside_the_code(prefix):
    installed = Path(proximity_monitor.__file__).parent / "scene"
    source = ROOT / NAME / "scene"
    data = [
        source / "schema.json",
        *(each for each in (source / "bundled").rglob("*") if each.is_file()),
    ]
    assert len(data) > 2
    for file in data:
        assert (installed / file.relative_to(source)).read_bytes() == file.read_bytes()

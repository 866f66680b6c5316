"""The command line, as far as it needs no ROS."""

import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from proximity_monitor.__main__ import main
from proximity_monitor.scene.paths import bundled_names


def test_without_a_command_it_teaches(capsys):
    assert main([]) == 0
    assert "demo" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments", [["--help"], ["demo", "--help"], ["scene", "check", "--help"]]
)
def test_help_is_help(arguments, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 0
    assert "usage: proximity_monitor" in capsys.readouterr().out


def test_the_demos_help_lists_every_bundled_scene_with_a_line(capsys):
    with pytest.raises(SystemExit):
        main(["demo", "--help"])
    said = capsys.readouterr().out
    listed = said.partition("bundled scenes:\n")[2].partition("\n\n")[0].splitlines()
    assert [line.split()[0] for line in listed] == bundled_names()
    for line in listed:
        _, *words = line.split()
        assert words, f"{line.strip()} has no description"


def test_without_yaml_the_demos_help_is_help_all_the_same():
    code = (
        "import sys; sys.modules['yaml'] = None\n"
        "from proximity_monitor.__main__ import main; sys.exit(main(['demo', '--help']))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.returncode == 0
    assert "--speed" in run.stdout
    assert "pip install '.[scene]'" in run.stdout


@pytest.mark.parametrize("value", ["0", "-1", "nan", "inf", "soon"])
@pytest.mark.parametrize("option", ["--seconds", "--speed"])
def test_a_duration_or_speed_that_is_none_is_refused(option, value, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["demo", f"{option}={value}"])
    assert ended.value.code == 2
    assert option in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "package", "extra"),
    [
        ("demo", "rclpy", "ros"),
        ("demo", "rich", "ros"),
        ("display", "viser", "ros,display"),
        ("scene check engine", "yaml", "scene"),
        ("scene check engine", "jsonschema", "scene"),
    ],
)
def test_without_a_package_a_command_says_how_to_install_it(command, package, extra):
    code = (
        f"import sys; sys.modules['{package}'] = None\n"
        f"from proximity_monitor.__main__ import main; sys.exit(main('{command}'.split()))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.returncode == 1
    assert package in run.stderr
    assert f"pip install '.[{extra}]'" in run.stderr
    assert "Traceback" not in run.stderr


def test_a_scene_is_checked_with_its_models(capsys):
    assert main(["scene", "check", "engine"]) == 0
    said = capsys.readouterr().out
    assert "body block" in said
    assert "pair piston_1 - piston_2" in said
    assert "motion slider_crank: 5 bodies, 12 rpm" in said


def test_a_check_says_what_bodies_are_made_of(tmp_path, capsys):
    shapes = (
        "sphere: {radius: 30}",
        "sphere: {radius: 30, subdivisions: 0}",
        "capsule: {radius: 5, length: 40}",
        "cylinder: {radius: 30, height: 9}",
        "cone: {radius: 30, height: 9}",
        "torus: {radius: 30, tube: 5}",
        "point: {}",
    )
    bodies = [f"  - {{name: b{i}, primitive: {{{s}}}, moving: true}}" for i, s in enumerate(shapes)]
    path = tmp_path / "shapes.yaml"
    path.write_text("\n".join(("version: 1", "unit: mm", "bodies:", *bodies, "pairs: all", "")))
    assert main(["scene", "check", str(path)]) == 0
    found = [line.rpartition(", moving")[0] for line in capsys.readouterr().out.splitlines()[1:8]]
    assert found == [
        "  body b0: sphere of radius 30 mm, solid",
        "  body b1: 20 triangles within 3.43 mm of the part, solid",
        "  body b2: capsule of radius 5 mm, solid",
        "  body b3: a profile of 3 curves, 6 control points up to 30 mm from the axis"
        ", exact except for rounding, solid",
        "  body b4: a profile of 2 curves, 4 control points up to 30 mm from the axis"
        ", exact except for rounding, solid",
        "  body b5: a profile of 1 curve, 9 control points up to 35 mm from the axis"
        ", exact except for rounding, solid",
        "  body b6: 1 triangle, a surface",
    ]


def test_what_is_wrong_with_a_scene_is_said(tmp_path, capsys):
    path = tmp_path / "torn.yaml"
    path.write_text("version: 1\n")
    assert main(["scene", "check", str(path)]) == 1
    assert "torn.yaml" in capsys.readouterr().err
    assert main(["scene", "check", str(tmp_path / "none.yaml")]) == 1
    assert "none.yaml" in capsys.readouterr().err


def test_a_check_refuses_two_bodies_on_one_topic_however_it_is_written(tmp_path, capsys):
    """A node without a namespace refuses them, too."""
    path = tmp_path / "shared.yaml"
    bodies = (f"  - {{name: {name}, primitive: {{point: {{}}}}, TOPIC}}" for name in "abc")
    text = "\n".join(("version: 1", "unit: mm", "bodies:", *bodies, ""))
    for topic in ("x", "/x", "~/x"):
        text = text.replace("TOPIC", f"topic: {topic}", 1)
    path.write_text(text)
    assert main(["scene", "check", str(path)]) == 1
    said = capsys.readouterr().err
    assert "shared.yaml: bodies 'a', 'b' read their poses from one topic, /x" in said
    path.write_text(text.replace("topic: /x", "topic: /y"))
    assert main(["scene", "check", str(path)]) == 0


@pytest.mark.parametrize("how", ["-m proximity_monitor demo", "scripts/node", "scripts/player"])
def test_an_interrupt_while_python_imports_ends_it_quietly(how):
    """Ctrl-C in the first moments, here as soon as numba is imported."""
    pytest.importorskip("rclpy", reason="rclpy is not importable: these commands need ROS 2")
    if how.startswith("-m"):
        start = (
            "sys.argv = ['', 'demo']; runpy.run_module('proximity_monitor', run_name='__main__')"
        )
    else:
        script = Path(__file__).resolve().parents[1] / how
        start = f"runpy.run_path({str(script)!r}, run_name='__main__')"
    code = (
        "import runpy, signal, sys\n"
        "class CtrlC:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'numba':\n"
        "            signal.raise_signal(signal.SIGINT)\n"
        f"sys.meta_path.insert(0, CtrlC())\n{start}"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.returncode in (130, -signal.SIGINT)  # which shells show as 130
    assert run.stdout == run.stderr == ""


def test_an_interrupt_that_comes_up_as_another_error_is_no_fault_of_the_scene(tmp_path):
    """Numba's compiler and file readers take an interrupt for bad input and raise another error."""
    code = (
        "import signal, sys\n"
        "class CtrlC:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'jsonschema':\n"
        "            try:\n"
        "                signal.raise_signal(signal.SIGINT)\n"
        "            except BaseException:\n"
        "                raise ValueError('not a readable file') from None\n"
        "sys.meta_path.insert(0, CtrlC())\n"
        "from proximity_monitor.__main__ import main\n"
        "sys.exit(main(['scene', 'check', sys.argv[1]]))"
    )
    path = tmp_path / "ball.yaml"
    path.write_text(
        "version: 1\nunit: m\nbodies:\n"
        "  - {name: one, primitive: {box: {size: [1, 1, 1]}}, moving: true}\n"
        "  - {name: two, primitive: {box: {size: [1, 1, 1]}}, moving: true}\n"
    )
    run = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True)
    assert (run.returncode, run.stderr) == (130, "")


def test_what_an_interrupt_cut_is_never_destroyed():
    """The destructor of an LLVM object crashes if its constructor or its owner was interrupted."""
    code = (
        "import os, signal, sys\n"
        "class Fragile:\n"
        "    def __del__(self, end=os._exit):\n"
        "        end(7)\n"
        "class CtrlC:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'jsonschema':\n"
        "            module = Fragile()\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "            while True:\n"
        "                pass\n"
        "sys.meta_path.insert(0, CtrlC())\n"
        "from proximity_monitor.__main__ import main\n"
        "sys.exit(main(['scene', 'check', 'none.yaml']))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (run.returncode, run.stderr) == (130, "")


@pytest.mark.long
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
@pytest.mark.parametrize(
    ("arguments", "needed"),
    [
        ("proximity_monitor scene check probe", "yaml"),
        ("proximity_monitor --help", "yaml"),
        ("proximity_monitor demo --scene probe --no-page", "rclpy"),
        ("proximity_monitor display --port 0", "viser"),
        ("proximity_monitor.study --help", "yaml"),
    ],
)
@pytest.mark.parametrize("flags", [[], ["-u"]])
def test_an_output_that_cannot_be_written_is_told_in_one_line(arguments, needed, flags):
    pytest.importorskip(needed)
    command = [sys.executable, *flags, "-m", *arguments.split()]
    with open("/dev/full", "w") as full:
        run = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert run.returncode == 1
    (line,) = run.stderr.splitlines()
    assert re.fullmatch(r".*proximity_\S+: the output cannot be written: No space left.*", line)


def test_a_reader_that_goes_away_ends_a_command_quietly():
    code = (
        "import os, sys; from proximity_monitor.__main__ import main\n"
        "reading, writing = os.pipe(); os.close(reading); os.dup2(writing, 1)\n"
        "sys.exit(main(['scene', 'check', 'probe']))"
    )
    run = subprocess.run([sys.executable, "-u", "-c", code], stderr=subprocess.PIPE, text=True)
    assert (run.returncode, run.stderr) == (1, "")

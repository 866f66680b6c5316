"""The page that comes with the demo."""

import contextlib
import os
import re
import signal
import subprocess
import sys
from urllib.request import ProxyHandler, build_opener

import numpy as np
import pytest
from deadlines import START_DEADLINE_S
from page_hand import TEXTS, button, choose, enter, listed, opened, press, row, tab, word

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

from proximity_monitor.ros import page_process

pytestmark = pytest.mark.long
ADDRESS_PREFIX = "Drag the parts and see their clearances at "
SCENE = """
version: 1
frame: bench
unit: mm
bodies:
  - {name: wall, primitive: {box: {size: [10, 200, 200]}}, pose: {position: [125, 0, 0]}}
  - {name: slide, primitive: {box: {size: [20, 20, 20]}}, moving: true}
pairs: all
motion: {script: {bodies: {slide: {slide: {axis: [1, 0, 0], offsets: [[0, 0], [2, 50]]}}}}}
"""


class Demo:
    """The demo in a process group of its own, and what it prints."""

    def __init__(self, command, log):
        self._log = log
        with log.open("w") as out:
            self._process = subprocess.Popen(command, stdout=out, start_new_session=True)

    def says(self, start):
        """Return the rest of the first whole line that begins with `start`; empty: none yet."""
        assert self._process.poll() is None, self.text
        lines = (line.lstrip() for line in self.text.splitlines(keepends=True))
        found = (x.removeprefix(start).strip() for x in lines if x.startswith(start) and "\n" in x)
        return next(found, "")

    def display(self):
        """Return the id of the page's process, a child of the demo."""
        asked = ["pgrep", "-P", f"{self._process.pid}", "-f", "proximity_monitor.display"]
        return int(subprocess.check_output(asked, text=True))

    def interrupt(self):
        """Send SIGINT, as Ctrl-C does, and return the exit code."""
        self._process.send_signal(signal.SIGINT)
        return self._process.wait(START_DEADLINE_S)

    def is_gone(self):
        """Return whether no process of the demo's group is left."""
        try:
            os.killpg(self._process.pid, 0)
        except ProcessLookupError:
            return True
        return False

    def kill(self):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    @property
    def text(self):
        return self._log.read_text()


@pytest.fixture
def demo(ros_environment, tmp_path, monkeypatch):
    """A function that starts the demo with arguments; the demo is killed in the end."""
    started = []
    path = tmp_path / "slide.yaml"
    path.write_text(SCENE)
    # A domain apart from the other tests' monitors, which have the same names.
    monkeypatch.setenv("ROS_DOMAIN_ID", str(int(os.environ["ROS_DOMAIN_ID"]) % 100 + 1))
    for desktop in ("DISPLAY", "WAYLAND_DISPLAY"):  # if one is set, the demo opens a browser
        monkeypatch.delenv(desktop, raising=False)

    def start(*arguments, scene=path):
        command = [sys.executable, "-m", "proximity_monitor", "demo", "--scene", scene, *arguments]
        started.append(Demo(command, tmp_path / f"demo_{len(started)}.log"))
        return started[-1]

    yield start
    for each in started:
        each.kill()


def test_the_demo_prints_its_address_and_takes_the_page_along_when_it_ends(demo, wait):
    process = demo()
    address = wait(lambda: process.says(ADDRESS_PREFIX), "the address", START_DEADLINE_S)
    with build_opener(ProxyHandler({})).open(address, timeout=60.0) as answer:
        assert answer.status == 200
    assert process.interrupt() == 0
    wait(process.is_gone, "the display to end")


def test_the_demo_can_do_without(demo, wait):
    process = demo("--no-page")
    wait(lambda: process.says("wall - slide"), "a clearance", START_DEADLINE_S)
    assert process.interrupt() == 0
    assert "Smallest clearance" in process.text
    assert "http" not in process.text


ADDRESS_LINE = "display: http://127.0.0.1:1"
ERROR = """[ERROR] [1.0] [proximity_display]: a page failed, KeyError: 'x'
  Traceback (most recent call last):
    File "page.py", line 1, in show
  KeyError: 'x'"""
INFO = "[INFO] [2.0] [proximity_display]: on"
UNCAUGHT = """Traceback (most recent call last):
  File "page.py", line 2, in run
OSError: no more room"""
KILLED = "import os; os.kill(os.getpid(), 9)"


@pytest.mark.parametrize(
    "printed, end, passed_on, last",
    [
        ([ERROR], "exit(1)", ERROR, "The page has ended (exit code 1): no message"),
        ([ERROR], KILLED, ERROR, "The page has ended: killed by SIGKILL"),
        (["a warning"], KILLED, "", "The page has ended: killed by SIGKILL"),
        (["no more room"], "exit(1)", "", "The page has ended (exit code 1): no more room"),
        (
            [ERROR, INFO, UNCAUGHT],
            "exit(1)",
            f"{ERROR}\n{UNCAUGHT}",
            "The page has ended (exit code 1): OSError: no more room",
        ),
        (
            [ERROR, UNCAUGHT],
            "exit(1)",
            f"{ERROR}\n{UNCAUGHT}",
            "The page has ended (exit code 1): OSError: no more room",
        ),
        ([UNCAUGHT, INFO], "exit(1)", "", "The page has ended (exit code 1): no message"),
    ],
)
def test_the_demo_passes_on_what_the_page_says_of_its_errors_and_its_end(
    printed, end, passed_on, last, tmp_path, monkeypatch, wait
):
    lines = "\n".join([ADDRESS_LINE, *printed])
    (tmp_path / "ends.py").write_text(f"print({lines!r}, flush=True)\n{end}\n")
    monkeypatch.setattr(page_process, "_MODULE", "ends")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    for desktop in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(desktop, raising=False)
    said = []
    process = page_process.PageProcess(said.append)
    wait(lambda: said and said[-1].startswith("The page has ended"), "the end")
    process.stop()
    assert said[0] == f"{ADDRESS_PREFIX}http://127.0.0.1:1"
    assert "\n".join(said[1:-1]) == passed_on
    assert said[-1] == last


def test_the_demo_says_that_no_page_came(tmp_path, monkeypatch, wait):
    (tmp_path / "ends.py").write_text('raise SystemExit("no more room")')
    monkeypatch.setattr(page_process, "_MODULE", "ends")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    said = []
    process = page_process.PageProcess(said.append)
    wait(lambda: said, "the end")
    process.stop()
    assert said == ["No page: no more room"]


# Whether a part's mesh is drawn flat, and its numbers of vertices and triangles.
DRAWN_AS = """i => {
  const props = window.__viserSceneTree.getState()[`/parts/${i}/mesh`].message.props;
  return [props.flat_shading, props.vertices.byteLength / 12, props.faces.byteLength / 12];
}"""


def on_blade(model, text, body):
    """Return the point (3,) in a model's frame that the page's text about a pair names."""
    told = re.search(rf"{body}: patch (\d+), u (\d\.\d{{3}}), v (\d\.\d{{3}})", text)
    assert told, text
    patch, u, v = told.groups()
    place = np.array([float(u)]), np.array([float(v)])
    return model.nets[int(patch)].derivatives(*place, 0)[0, 0, 0]


def test_the_turbine_on_the_page(demo, browser, wait, eventually):
    """Check looks, clearances, features and moving by hand; the bundled scene hardly moves."""
    from proximity_monitor import engine, motion, scene
    from proximity_monitor.scene.opening import load_models

    described = scene.load_scene(scene.bundled("turbine"))
    models = load_models(described)
    poses = {"shroud": np.eye(4)} | motion.from_scene(described, models).poses(0.0)

    def of_engine(pair):
        a, b = pair.split(" - ")
        return engine.distance(models[a], poses[a], models[b], poses[b])

    process = demo("--speed", "1e-9", scene="turbine")
    address = wait(lambda: process.says(ADDRESS_PREFIX), "the address", START_DEADLINE_S)
    page = opened(browser, address)
    page.wait_for_selector("#pm-pairs .pm-row", timeout=1e3 * START_DEADLINE_S)

    def clearances():
        found = listed(page)
        assert {f"blade_{i} - shroud" for i in range(1, 9)} <= set(found)
        assert next(iter(found)) == "blade_3 - shroud"
        for pair, (lower, upper, text) in found.items():
            true = of_engine(pair)
            assert lower <= true.upper + 1e-9 and true.lower <= upper + 1e-9, pair
            assert upper - lower < 2e-7 and f"{1e3 * upper:.3f} mm" in text, text
        nearest = f"{1e3 * found['blade_3 - shroud'][1]:.3f} mm"
        labels = page.evaluate(TEXTS, "/distances")
        assert f"▲ {nearest}\nblade_3 - shroud" in labels

    eventually(clearances)
    for i, body in enumerate(described.bodies):
        flat, vertices, triangles = page.evaluate(DRAWN_AS, i)
        assert not flat and vertices < triangles, body.name

    press(page, '[data-pair="blade_3 - shroud"]')

    def features():
        text = row(page, "blade_3 - shroud")[2]
        near = of_engine("blade_3 - shroud")
        for body, point in (("blade_3", near.point_a), ("shroud", near.point_b)):
            place, pose = on_blade(models[body], text, body), poses[body]
            np.testing.assert_allclose(pose[:3, :3] @ place, point, atol=3e-4)  # 3 digits of u, v

    eventually(features)
    press(page, '[data-pair="blade_3 - shroud"]')

    choose(page, "blade_1")  # it points up
    for height, told in ((0.3, "warn"), (0.6, "OVERLAP")):
        tab(page, "Move")
        enter(page, "Position [mm]", f"{height}", 2)
        button(page, "Put it there").click()
        tab(page, "Clearances")
        poses["blade_1"][2, 3] = 1e-3 * height
        true = of_engine("blade_1 - shroud")
        assert (true.lower > 0.0) == (told == "warn")

        def followed(told=told, true=true):
            found = row(page, "blade_1 - shroud")
            if told == "warn":
                assert found[1] == pytest.approx(true.upper, abs=2e-7)
            else:  # both are solids
                assert found[1] < 0.0
            assert word(page) == told
            assert told in found[2]

        eventually(followed)
    page.close()
    assert page.errors == []
    os.kill(process.display(), signal.SIGKILL)
    ended = "The page has ended: "
    assert wait(lambda: process.says(ended), "the demo to say so") == "killed by SIGKILL"
    assert process.interrupt() == 0

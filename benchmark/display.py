"""How many updates a second the page gets, with 20 parts of 20,000 triangles and 190 pairs.

    python benchmark/display.py --seconds 20     # in an environment with '.[ros,display]'

The monitor, the display and the player, which sends the poses, run in processes of their own. If
the machine has two cores, the display has another core than the monitor. This process stands for
the browser: it receives what the display sends over the websocket, and counts the frames that bring
new closest points. The time to draw them depends on the graphics card and is not measured.
"""

from __future__ import annotations

import argparse
import itertools
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from queue import SimpleQueue
from threading import Thread, Timer

import msgspec
import viser
import zstandard
from websockets.sync.client import connect

SCENE = """\
version: 1
frame: world
unit: mm
rate_hz: {rate}
budget_ms: {budget}
thresholds: {{warn: 20, stop: 2}}
bodies:
{bodies}
pairs: all
motion:
  script:
    bodies:
{moves}
"""
BODY = (
    "  - {{name: part_{i}, primitive: {{sphere: {{radius: 50, subdivisions: 5}}}}, moving: true}}"
)
CROWD = """\
version: 1
frame: world
unit: mm
rate_hz: {rate}
budget_ms: 50
thresholds: {{warn: 30, stop: 10}}
bodies:
{bodies}
pairs: {{watch: [{{between: [all, all], range: 140}}]}}
motion:
  script:
    bodies:
{moves}
"""
BALL = (
    "  - {{name: ball_{i}, primitive: {{sphere: {{radius: 20, subdivisions: 1}}}}, moving: true}}"
)
SIDE = 10
"""Bodies along each edge of the crowd."""

START_S = 300.0  # the first start on a machine compiles the kernels
STOP_S = 10.0
MOVED = b"/distances/points"
LIST = b'id="pm-pairs"'
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [3.0, 3.0, 3.0],
    "fov": 1.3,
    "near": 0.1,
    "far": 1000.0,
    "image_height": 640,
    "image_width": 1000,
    "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}


class Child:
    """A process that runs one of our programs, and its output."""

    def __init__(self, module: str, arguments: list[str], core: int | None) -> None:
        """Start the program on a core, by its index among those allowed; None: on any."""
        command = [sys.executable, "-c", f"import sys; from {module} import main; sys.exit(main())"]
        self.process = subprocess.Popen(
            [*command, "--ros-args", *arguments],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        if core is not None:
            os.sched_setaffinity(self.process.pid, {sorted(os.sched_getaffinity(0))[core]})
        self.said: list[str] = []
        self._news: SimpleQueue[str] = SimpleQueue()
        Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        for line in self.process.stdout:
            self.said.append(line)
            self._news.put(line)
        self._news.put("")  # it has ended

    def wait_for(self, start: str) -> str:
        """Return the rest of the first line that starts with `start`, as soon as it is printed."""
        patience = Timer(START_S, self.process.kill)
        patience.start()
        try:
            while line := self._news.get():
                if line.startswith(start):
                    return line.removeprefix(start).strip()
        finally:
            patience.cancel()
        raise RuntimeError(f"ended before it printed {start!r}; it printed:\n{''.join(self.said)}")

    def seconds(self) -> float:
        """Return the processor time so far, seconds."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def stop(self) -> None:
        """End the program: by SIGINT, or by force if it does not end in time."""
        self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def scene_text(parts: int, rate: float, budget: float) -> str:
    """Return a scene of spheres on a grid, each of which moves to and fro by itself."""
    rng = random.Random(1)
    bodies, moves = [], []
    for i in range(parts):
        home = [180.0 * (i % 5), 180.0 * (i // 5), 0.0]
        there = [x + rng.uniform(-30.0, 30.0) for x in home]
        half = rng.uniform(1.0, 4.0)
        keys = [(0.0, home), (half, there), (2.0 * half, home)]
        bodies.append(BODY.format(i=i))
        told = ", ".join(f"{{t: {t:.3f}, position: {place}}}" for t, place in keys)
        moves.append(f"      part_{i}: {{keys: [{told}]}}")
    return SCENE.format(rate=rate, budget=budget, bodies="\n".join(bodies), moves="\n".join(moves))


def crowd_text(rate: float) -> str:
    """Return a scene of balls on a lattice, each of which moves to and fro by itself."""
    rng = random.Random(1)
    bodies, moves = [], []
    for i, place in enumerate(itertools.product(range(SIDE), repeat=3)):
        home = [100.0 * x for x in place]
        there = [x + rng.uniform(-5.0, 5.0) for x in home]
        half = rng.uniform(1.0, 4.0)
        keys = [(0.0, home), (half, there), (2.0 * half, home)]
        bodies.append(BALL.format(i=i))
        told = ", ".join(f"{{t: {t:.3f}, position: {at}}}" for t, at in keys)
        moves.append(f"      ball_{i}: {{keys: [{told}]}}")
    return CROWD.format(rate=rate, bodies="\n".join(bodies), moves="\n".join(moves))


def main() -> int:
    """Measure, print a table and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="duration (default: 20)")
    parser.add_argument("--parts", type=int, default=20, help="number of parts (default: 20)")
    parser.add_argument("--rate", type=float, default=30.0, help="the monitor's ticks per second")
    parser.add_argument("--budget", type=float, default=20.0, help="time budget of a tick, ms")
    parser.add_argument(
        "--crowd", action="store_true", help="use 1,000 bodies with 10,476 pairs in range"
    )
    chosen = parser.parse_args()
    os.environ["ROS_DOMAIN_ID"] = str(random.SystemRandom().randint(1, 100))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    last = len(os.sched_getaffinity(0)) - 1
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "ring.yaml"
        moving = scene_text(chosen.parts, chosen.rate, chosen.budget)
        scene.write_text(crowd_text(chosen.rate) if chosen.crowd else moving)
        ros = "proximity_monitor.ros"
        given = ["-p", f"scene:={scene}"]
        children = [
            Child(f"{ros}.node", given, 0),
            Child(f"{ros}.player", [*given, "-p", f"bulk:={str(chosen.crowd).lower()}"], 0),
            Child("proximity_monitor.display.run", ["-p", "port:=0"], last),
        ]
        try:
            return report(children, chosen)
        finally:
            for child in children:
                child.stop()


def report(children: list[Child], chosen: argparse.Namespace) -> int:
    """Wait until the page gets its first points, count updates, and print; return the status."""
    address = children[-1].wait_for("display: ")
    with connect(
        address.replace("http", "ws", 1), subprotocols=[f"viser-v{viser.__version__}"],
        max_size=None, compression=None, ping_timeout=None,
    ) as socket:  # fmt: skip
        socket.send(msgspec.msgpack.encode(CAMERA))  # from then on the browser counts as connected
        ends = time.monotonic() + START_S
        while not brings_points(socket.recv(timeout=START_S)):
            if time.monotonic() > ends:
                said = "".join(line for child in children for line in child.said)
                print(f"no frame arrived; the processes printed:\n{said}")
                return 1
        used = [child.seconds() for child in children]
        began = time.monotonic()
        stamps, size, lists = [began], 0, 0
        while stamps[-1] < began + chosen.seconds:
            data = socket.recv(timeout=START_S)
            size += len(data)
            lists += brings(data, "GuiUpdateMessage", LIST)
            if brings_points(data):
                stamps.append(time.monotonic())
        took = stamps[-1] - began
        gaps = sorted(1e3 * (b - a) for a, b in itertools.pairwise(stamps))
        share = [100.0 * (c.seconds() - u) / took for c, u in zip(children, used, strict=True)]
    n = chosen.parts
    parts = f"{n} parts of 20,480 triangles, {n * (n - 1) // 2} pairs"
    parts = f"{SIDE**3} bodies, 10,476 pairs in range" if chosen.crowd else parts
    print(f"{parts}, {took:.1f} s")
    print(f"  ticks asked for                 {chosen.rate:8.1f} a second")
    print(f"  updates of the page             {len(gaps) / took:8.1f} a second")
    print(f"  other lists of pairs            {lists / took:8.1f} a second")
    print(f"  between two, median             {gaps[len(gaps) // 2]:8.1f} ms")
    print(f"  between two, 99th percentile    {gaps[int(0.99 * len(gaps))]:8.1f} ms")
    print(f"  sent to the browser             {size / took / 1e3:8.1f} kB a second")
    for name, percent in zip(("monitor", "player", "display"), share, strict=True):
        print(f"  processor time, {name:16}{percent:8.1f} % of a core")
    return 0


def brings_points(data: bytes) -> bool:
    """Return whether a websocket frame brings new closest points."""
    return brings(data, "SceneNodeUpdateMessage", MOVED)


def brings(data: bytes, kind: str, sign: bytes) -> bool:
    """Return whether a frame has a message of this kind whose name or updates contain `sign`."""
    size = int.from_bytes(data[8:16], "little")
    told = zstandard.ZstdDecompressor().decompress(data[16 : 16 + size])
    return sign in told and any(
        message["type"] == kind and sign.decode() in f"{message.get('name')} {message['updates']}"
        for message in msgspec.msgpack.decode(told)["messages"]
    )


if __name__ == "__main__":
    sys.exit(main())

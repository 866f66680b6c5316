"""Time from a drag to the new clearance, with 20 parts of 20,000 triangles and 190 pairs.

    python benchmark/drag.py --steps 300     # in an environment with '.[ros,display]'

This process stands for the browser, as in display.py. It moves the handles of a part in steps, and
takes the time from each step's message until the message with the new clearance arrives. The
nearest part rests and the other 18 move meanwhile, so that only the drag changes that clearance.
browser.py measures the time that Chromium needs as well, to report events and to draw.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import viser
import zstandard
from display import CAMERA, START_S, Child, scene_text
from websockets.sync.client import ClientConnection, connect

NAMES = ("monitor", "player", "display")
HELD = "part_0"
PAIR = "part_0 - anvil"
ANVIL = """\
  - name: anvil
    primitive: {sphere: {radius: 50, subdivisions: 5}}
    pose: {position: [-130, 0, 0]}
"""
STEP = 0.02
"""Length of a step, in the page's units: 2 mm."""

LOST_S = 5.0
"""Seconds after which a step's number counts as lost."""

NUMBER = re.compile(rf"{PAIR}</span><span class=pm-num>([^<]*)<")
TOLD = ("to its number", "median, 90 %, 99 % [ms]")


def drag_text(parts: int, rate: float, subdivisions: int) -> str:
    """Return the scene of display.py, with a part at rest beside the part to drag."""
    text = scene_text(parts - 1, rate, 20.0).replace("pairs: all", f"{ANVIL}pairs: all")
    return text.replace("subdivisions: 5", f"subdivisions: {subdivisions}")


def percentiles(values: list[float]) -> str:
    """Return the median, 90 % and 99 % of times in milliseconds."""
    ordered = sorted(values)
    at = (ordered[min(int(share * len(ordered)), len(ordered) - 1)] for share in (0.5, 0.9, 0.99))
    return "".join(f"{value:8.0f}" for value in at)


class Hand:
    """A websocket client that drags the part, and reads its clearance and its handles' place."""

    def __init__(self, socket: ClientConnection) -> None:
        """Choose the part, wait until its clearance is shown, and start the drag."""
        self._socket = socket
        self.number = ""
        self._place: list[float] | None = None
        self._part = self._owner = ""
        self._offered = False
        self.say("ViewerCameraMessage", **{k: v for k, v in CAMERA.items() if k != "type"})
        while not self._offered:
            self.hear(START_S)
        self.say("GuiUpdateMessage", uuid=self._part, updates={"value": HELD})
        while self._place is None or not self.number:
            self.hear(START_S)
        self._home = self._place
        self.say("TransformControlsDragStartMessage", name="/gizmo", owner=self._owner)

    def say(self, kind: str, **fields: Any) -> None:
        """Send a message."""
        self._socket.send(msgspec.msgpack.encode({"type": kind} | fields))

    def move(self, along: float) -> None:
        """Move the handles to `along` on the x axis, from where they were at first."""
        x, y, z = self._home
        there = {"wxyz": [1.0, 0.0, 0.0, 0.0], "position": [x + along, y, z]}
        self.say("TransformControlsUpdateMessage", name="/gizmo", owner=self._owner, **there)

    def hear(self, timeout_s: float) -> None:
        """Receive the next messages and take from them what the drag needs.

        Raises:
            TimeoutError: nothing comes in time.
        """
        for message in _messages(self._socket.recv(timeout=timeout_s)):
            kind = message["type"]
            if kind == "GuiDropdownMessage" and message["props"]["label"] == "Part":
                self._part = message["uuid"]
            elif kind == "TransformControlsMessage":
                self._owner = message["owner"]
            elif kind == "SetPositionMessage" and message["name"] == "/gizmo":
                self._place = list(message["position"])
            elif kind == "GuiUpdateMessage":
                if message["uuid"] == self._part:
                    self._offered |= HELD in message["updates"].get("options", ())
                found = NUMBER.search(str(message["updates"].get("content", "")))
                if found is not None:
                    self.number = found[1]

    def rest(self, seconds: float) -> None:
        """Receive messages for so many seconds."""
        ends = time.monotonic() + seconds
        while (left := ends - time.monotonic()) > 0.0:
            try:
                self.hear(left)
            except TimeoutError:
                return


def _messages(data: bytes) -> Iterator[dict[str, Any]]:
    size = int.from_bytes(data[8:16], "little")
    told = zstandard.ZstdDecompressor().decompress(data[16 : 16 + size])
    yield from msgspec.msgpack.decode(told)["messages"]


def drag_times(hand: Hand, steps: int) -> list[float]:
    """Move in steps, and return the times (ms) until the number changes; infinite if lost."""
    rng, found = random.Random(2), []
    for i in range(steps):
        before, began = hand.number, time.monotonic()
        hand.move(STEP * (1 + i % 2))
        while hand.number == before and time.monotonic() < began + LOST_S:
            hand.hear(LOST_S)
        lost = hand.number == before
        found.append(float("inf") if lost else 1e3 * (time.monotonic() - began))
        hand.rest(rng.uniform(0.15, 0.25))  # at random: out of step with the ticks
    return found


def main() -> int:
    """Measure, print and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=300, help="steps of the drag (default: 300)")
    parser.add_argument("--parts", type=int, default=20, help="number of parts (default: 20)")
    parser.add_argument("--rate", type=float, default=30.0, help="the monitor's ticks per second")
    chosen = parser.parse_args()
    os.environ["ROS_DOMAIN_ID"] = str(random.SystemRandom().randint(1, 100))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "drag.yaml"
        scene.write_text(drag_text(chosen.parts, chosen.rate, 5))
        given = ["-p", f"scene:={scene}"]
        children = [
            Child("proximity_monitor.ros.node", given, None),
            Child("proximity_monitor.ros.player", given, None),
            Child("proximity_monitor.display.run", ["-p", "port:=0"], None),
        ]
        try:
            address = children[-1].wait_for("display: ")
            with connect(
                address.replace("http", "ws", 1), subprotocols=[f"viser-v{viser.__version__}"],
                max_size=None, compression=None, ping_timeout=None,
            ) as socket:  # fmt: skip
                hand = Hand(socket)
                # Not counted: the drag begins, and the player releases the part.
                drag_times(hand, 4)
                used, began = [child.seconds() for child in children], time.monotonic()
                times = drag_times(hand, chosen.steps)
                lasted = time.monotonic() - began
                share = [c.seconds() - u for c, u in zip(children, used, strict=True)]
        finally:
            for child in children:
                child.stop()
    print(f"{chosen.parts} parts of 20,480 triangles, {len(times)} steps of a drag")
    print(f"  {TOLD[0]:20} {TOLD[1]}{percentiles(times)}")
    for name, seconds in zip(NAMES, share, strict=True):
        print(f"  processor time, {name:16}{100.0 * seconds / lasted:8.1f} % of a core")
    return 0


if __name__ == "__main__":
    sys.exit(main())

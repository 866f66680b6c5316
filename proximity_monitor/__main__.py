"""The command line: ``proximity_monitor`` or ``python -m proximity_monitor``."""

from __future__ import annotations

import argparse
import atexit
import itertools
import json
import math
import signal
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from proximity_monitor.ending import checked_output, leave_now, leave_with

if TYPE_CHECKING:
    from types import FrameType

    from proximity_monitor import engine
    from proximity_monitor.scene import Unit

_INSTALL_SCENE = """\
proximity_monitor scene needs packages that read scene files: {error}
Install them together with this package, in the checkout:
    pip install '.[scene]'"""

_INSTALL_ROS = """\
proximity_monitor demo needs ROS 2's Python packages: {error}
Either install their wheels together with this package, in the checkout:
    pip install '.[ros]'
or, on a machine with ROS 2 Jazzy, source it first:
    . /opt/ros/jazzy/setup.sh"""

_INSTALL_DISPLAY = """\
proximity_monitor display needs viser and ROS 2's Python packages: {error}
Either install both as wheels together with this package, in the checkout:
    pip install '.[ros,display]'
or, on a machine with ROS 2 Jazzy, source it first, and:
    pip install '.[nodes,display]'"""


_SCENES = "bundled scenes:"

_ROUNDED = 1e-13
"""A deviation of at most this fraction of the model's size is called rounding."""

_LISTED = 100
"""How many pairs `scene check` prints one by one."""


class _WithScenes(argparse.HelpFormatter):
    """Lists the bundled scenes in the epilog.

    argparse formats only the help that it shows, so no other command reads the scene files.
    """

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        head, found, rest = text.partition(_SCENES)
        filled = super()._fill_text((head + rest).strip(), width, indent)
        return f"{_bundled_scenes()}\n\n{filled}" if found else filled


def _bundled_scenes() -> str:
    try:
        from proximity_monitor.scene.opening import descriptions
    except ImportError as error:
        return f"{_SCENES} listing them needs {error.name}: pip install '.[scene]'"
    said = descriptions()
    longest = max(map(len, said), default=0)
    return "\n".join([_SCENES, *(f"  {name:{longest}}  {said[name]}" for name in said)])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Returns:
        The exit code. It is 130 after a Ctrl-C that the command does not handle itself, as while
        Python still imports. A wrong command line raises `SystemExit` with code 2.
    """
    cut: list[FrameType | None] = []  # the interrupted frames, kept alive: see `_leave`

    def interrupt(_: int, frame: FrameType | None) -> None:
        if not cut:
            atexit.register(_leave, cut)
        cut.append(frame)
        raise KeyboardInterrupt

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)
    try:
        with checked_output("proximity_monitor"):
            parser = _parser()
            chosen = parser.parse_args(arguments)
            if chosen.run is None:
                parser.print_help()
                return 0
            return _run(chosen)
    except KeyboardInterrupt:
        return 130
    except Exception as error:
        # Numba's compiler and the file readers report an interrupt as an error in their input.
        if cut:
            return 130
        if isinstance(error, chosen.told):
            print(error, file=sys.stderr)
            return 1
        raise
    finally:
        if signal.getsignal(signal.SIGINT) is interrupt:
            signal.signal(signal.SIGINT, signal.default_int_handler)


def _leave(kept: list[FrameType | None]) -> None:
    """End an interrupted process while the interrupted frames (`kept`) still exist.

    Otherwise a module that LLVM was linking would be freed twice: see `leave_with` in ending.py.
    """
    leave_now(130)


def _run(chosen: argparse.Namespace) -> int:
    try:
        return chosen.run(chosen)
    except ImportError as error:
        if error.name is None or error.name.startswith("proximity_monitor"):
            raise  # a bug of this package, which no installation mends
        print(chosen.install.format(error=error), file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="proximity_monitor",
        description="Certified clearances between the moving bodies of an assembly.",
        epilog="The ROS 2 nodes: ros2 run proximity_monitor node (or player)",
    )
    parser.set_defaults(run=None, told=())
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")

    demo = commands.add_parser(
        "demo",
        formatter_class=_WithScenes,
        help="run monitor and player together and show the clearances live",
        description="Starts the monitor and the player that moves the scene's bodies, and shows"
        " what the monitor publishes: a live table in a terminal, or lines once a second elsewhere."
        " It also serves a page on which the parts can be dragged, and prints its address."
        " Ends on Ctrl-C, or after --seconds, with a summary.",
        epilog=f"{_SCENES}\n\nexample: proximity_monitor demo --scene engine --speed 0.25",
    )
    demo.add_argument(
        "--scene",
        default="engine",
        metavar="NAME|FILE",
        help="a bundled scene (see below) or a scene file with a motion section (default: engine)",
    )
    demo.add_argument(
        "--seconds",
        type=_positive,
        default=None,
        metavar="S",
        help="stop S seconds after the first result",
    )
    demo.add_argument(
        "--speed",
        type=_positive,
        default=1.0,
        metavar="X",
        help="play the motion X times as fast (default: 1)",
    )
    demo.add_argument("--no-page", action="store_true", help="do not serve the browser page")
    demo.set_defaults(run=_demo, install=_INSTALL_ROS)

    display = commands.add_parser(
        "display",
        help="show a running monitor's scene in a browser",
        description="Serves a page that shows the clearances and on which parts can be dragged, and"
        " prints its address. It receives from a monitor on this machine or on another one in the"
        " network. Ends on Ctrl-C. There is no login: anyone who can reach the address can move the"
        " bodies.",
        epilog="example: proximity_monitor display --port 8080",
    )
    display.add_argument(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="address of this machine to listen on (default: 127.0.0.1, reachable only from it)",
    )
    display.add_argument(
        "--port",
        type=int,
        default=8080,
        metavar="N",
        help="the first port to try; 0: any free port (default: 8080)",
    )
    display.set_defaults(run=_display, install=_INSTALL_DISPLAY)

    scene = commands.add_parser("scene", help="work with scene files")
    scene.set_defaults(run=lambda _: scene.print_help() or 0)
    scenes = scene.add_subparsers(title="commands", metavar="COMMAND")
    check = scenes.add_parser(
        "check",
        help="check a scene file and list its contents",
        description="Reads a scene file, its models, and what its motion needs. Prints what is"
        " wrong with them or, if nothing is, what is watched and moved. The exit code is 1 if the"
        " scene cannot be used.",
    )
    check.add_argument("scene", metavar="NAME|FILE", help="a scene file or a bundled scene")
    check.set_defaults(run=_check, install=_INSTALL_SCENE, told=(OSError, ValueError))
    return parser


def _demo(chosen: argparse.Namespace) -> int:
    from proximity_monitor.ros.demo import run

    page = not chosen.no_page
    return leave_with(run(chosen.scene, seconds=chosen.seconds, speed=chosen.speed, page=page))


def _display(chosen: argparse.Namespace) -> int:
    from proximity_monitor.display.run import main

    # ROS reads a parameter's value as YAML; the quotes keep every host a string.
    parameters = "-p", f"host:={json.dumps(chosen.host)}", "-p", f"port:={chosen.port}"
    return leave_with(main(["--ros-args", *parameters]))


def _check(chosen: argparse.Namespace) -> int:
    from proximity_monitor import motion
    from proximity_monitor.scene import load_scene
    from proximity_monitor.scene.bodies import check_topics
    from proximity_monitor.scene.naming import safe
    from proximity_monitor.scene.opening import find_scene, load_models
    from proximity_monitor.scene.unseen import unseen_containment

    scene = load_scene(find_scene(chosen.scene))
    check_topics(scene.bodies, str(scene.path))
    models = load_models(scene)
    moves = motion.from_scene(scene, models).describe() if scene.motion is not None else ""
    print(f"{scene.path}: frame {scene.frame}, {scene.rate_hz:g} Hz, {scene.budget_s * 1e3:g} ms")
    for body in scene.bodies:
        where = f"moving, {body.topic or 'by joints'}" if body.moving else "fixed"
        if body.cloud is not None:
            where = f"a cloud, {body.cloud.topic}, in frame {body.cloud.frame or scene.frame}"
        if safe(body.name) != body.name:
            where += f"; {safe(body.name)} in topics and parameters"
        print(f"  body {body.name}: {_shape(models[body.name], scene.unit)}, {where}")
    if len(scene.pairs) > _LISTED:
        print(f"  {len(scene.pairs)} pairs; the first {_LISTED}:")
    for pair in itertools.islice(scene.pairs, _LISTED):
        limits = pair.thresholds
        warn, stop = (x / scene.unit.to_metre for x in (limits.warn, limits.stop))
        print(f"  pair {pair.a} - {pair.b}: warn {warn:g}, stop {stop:g} {scene.unit.symbol}")
    for line in moves.splitlines():
        print(f"  motion {line}")
    for line in scene.warnings:
        print(f"  warning: {line}")
    for line in str(unseen_containment(scene, models)).splitlines():
        print(f"  warning: {line}")
    return 0


def _shape(model: engine.Model, unit: Unit) -> str:
    """Describe a model, its deviation, and whether it is a solid."""
    found = model.describe(lambda metres: f"{metres / unit.to_metre:.6g} {unit.symbol}")
    if 0.0 < model.deviation <= _ROUNDED * (math.hypot(*model.centre) + model.radius):
        found += ", exact except for rounding"
    elif model.deviation > 0.0:
        found += f" within {model.deviation / unit.to_metre:.3g} {unit.symbol} of the part"
    return found + (", solid" if model.is_solid else ", a surface")


def _positive(text: str) -> float:
    value = float(text)
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"must be a number above 0, not {text}")
    return value


if __name__ == "__main__":
    sys.exit(main())

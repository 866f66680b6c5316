"""The command line: ``proximity_monitor`` or ``python -m proximity_monitor``."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence

_INSTALL_ROS = """\
proximity_monitor demo needs ROS 2's Python packages: {error}
Either install their wheels beside this package, in the checkout:
    pip install '.[ros]'
or, on a machine with ROS 2 Jazzy, source it first:
    . /opt/ros/jazzy/setup.sh"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Returns:
        The exit code: 130 after a Ctrl-C while Python still imports, as later ones end a command in
        good order; 2, by `SystemExit`, for a wrong command line.
    """
    try:
        parser = _parser()
        chosen = parser.parse_args(arguments)
        if chosen.run is None:
            parser.print_help()
            return 0
        return chosen.run(chosen)
    except KeyboardInterrupt:
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="proximity_monitor",
        description="Certified clearances between the moving bodies of an assembly.",
        epilog="The ROS 2 nodes: ros2 run proximity_monitor node (or player)",
    )
    parser.set_defaults(run=None)
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")

    demo = commands.add_parser(
        "demo",
        help="run monitor and player together and show the clearances live",
        description="Starts the monitor and the player that moves the scene's bodies, and shows"
        " what the monitor publishes: a live table in a terminal, lines once a second elsewhere."
        " Ends on Ctrl-C, or after --seconds, with a summary.",
        epilog="example: proximity_monitor demo --scene engine --speed 0.25 --seconds 20",
    )
    demo.add_argument(
        "--scene",
        default="engine",
        metavar="NAME|FILE",
        help="a bundled scene or a scene file with a motion section (default: engine)",
    )
    demo.add_argument(
        "--seconds", type=_positive, default=None, metavar="S", help="end by itself after S seconds"
    )
    demo.add_argument(
        "--speed",
        type=_positive,
        default=1.0,
        metavar="X",
        help="play the motion X times as fast (default: 1)",
    )
    demo.set_defaults(run=_demo)

    scene = commands.add_parser("scene", help="work with scene files")
    scene.set_defaults(run=lambda _: scene.print_help() or 0)
    scenes = scene.add_subparsers(title="commands", metavar="COMMAND")
    check = scenes.add_parser(
        "check",
        help="say what is wrong with a scene file, or what is in it",
        description="Reads a scene file and its models, and says what is wrong with them, or what"
        " is watched. The exit code is 1 if the scene cannot be used.",
    )
    check.add_argument("scene", metavar="NAME|FILE", help="a scene file or a bundled scene")
    check.set_defaults(run=_check)
    return parser


def _demo(chosen: argparse.Namespace) -> int:
    try:
        from proximity_monitor.ros.demo import run
    except ImportError as error:
        if (error.name or "").startswith("proximity_monitor"):
            raise  # our own fault, that no installation mends
        print(_INSTALL_ROS.format(error=error), file=sys.stderr)
        return 1
    return run(chosen.scene, seconds=chosen.seconds, speed=chosen.speed)


def _check(chosen: argparse.Namespace) -> int:
    from proximity_monitor.scene import load_scene
    from proximity_monitor.scene.opening import find_scene, load_models

    try:
        scene = load_scene(find_scene(chosen.scene))
        models = load_models(scene)
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{scene.path}: frame {scene.frame}, {scene.rate_hz:g} Hz, {scene.budget_s * 1e3:g} ms")
    for body in scene.bodies:
        where = f"moving, {body.topic}" if body.moving else "fixed"
        print(f"  body {body.name}: {len(models[body.name].faces)} triangles, {where}")
    for pair in scene.pairs:
        limits = pair.thresholds
        warn, stop = (x / scene.unit.to_metre for x in (limits.warn, limits.stop))
        print(f"  pair {pair.a} - {pair.b}: warn {warn:g}, stop {stop:g} {scene.unit.symbol}")
    return 0


def _positive(text: str) -> float:
    value = float(text)
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"must be a number above 0, not {text}")
    return value


if __name__ == "__main__":
    sys.exit(main())

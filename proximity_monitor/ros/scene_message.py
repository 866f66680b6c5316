"""The scene for a viewer on another machine: ``~/scene``, latched, JSON in a String.

It is JSON because common_interfaces has no type for named things of several kinds. All lengths are
in metres; `unit` is the unit for people. It is published again if a setting in it changes, if a
body receives a new shape for the first time, if the held attachments change, or if there is a new
word.

==================  ===========================================================================
``name``            of the scene file, without its suffix; of its folder if it is a scene.yaml
``path``            of the scene file, on the monitor's machine
``description``     one line
``frame``           of all poses and points
``unit``            ``symbol`` and ``to_metre``
``bodies``          in the scene's order, which is that of the markers of ``~/parts``: ``name``;
                    ``moving``; ``topic``, the full name of its PoseStamped topic, or null if the
                    monitor does not subscribe to one; ``point``, whether it is a single point;
                    ``mesh``, a checksum; ``colour`` (red, green, blue, opacity); ``pose`` (x y z,
                    quaternion w x y z) if it is fixed, else null; and ``range``: its pairs that
                    ``~/pairs`` does not list are farther apart; null: all are listed
``checksum``        CRC-32 of the bodies' names, which ``~/pairs`` has as well
``words``           texts for which ``~/pairs`` has numbers; new texts are appended
``deforming``       names of the bodies that have received a new shape since the start
``pairs``           the number of watched pairs
``thresholds``      ``warn``, ``stop`` and ``hysteresis`` of the pairs that have none of their own
``own_thresholds``  a list of pairs with their own: ``a``, ``b`` and the same three keys
``attachments``     the parent's name by the child's, as set
``held``            the attachments in force: the child moves with its parent, and its own poses do
                    not count. All others wait until the poses of both are known and fresh
``unwatched``       a list of pairs, two names each in the scene's order, that are not watched now
                    because one body holds the other
``own_parameters``  whether the own thresholds are parameters, ``pairs.<a>.<b>.<key>``
``settings``        in force: ``rate_hz``, ``budget_ms``, ``pose_timeout_s``, and ``rel_err`` and
                    ``abs_err``, null if each pair has its own
==================  ===========================================================================
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from std_msgs.msg import String

from proximity_monitor import engine
from proximity_monitor.ros.pairs_message import checksum
from proximity_monitor.ros.parts import to_quaternion
from proximity_monitor.ros.scene_parameters import MAX_PAIRS, Settings
from proximity_monitor.scene import Body, Scene, Thresholds
from proximity_monitor.scene.description import Point


class SceneMessage:
    """Makes the message; its constant parts are made once."""

    def __init__(
        self,
        scene: Scene,
        models: Mapping[str, engine.Model],
        full_name: Callable[[str], str],
    ) -> None:
        """Take the scene, its models by body, and a function that returns a topic's full name."""
        self._scene = scene
        self._own = []
        ranges = {body.name: math.inf for body in scene.bodies}
        for i, pair in enumerate(scene.pairs):
            if pair.own_thresholds:
                self._own.append(i)
            for name in (pair.a, pair.b):
                ranges[name] = min(ranges[name], pair.range)
        self._bodies = [
            _body(body, models[body.name], full_name, ranges[body.name]) for body in scene.bodies
        ]
        self._checksum = checksum([body.name for body in scene.bodies])
        with_own = set(self._own)
        self._common = next((i for i in range(len(scene.pairs)) if i not in with_own), None)

    def message(
        self,
        settings: Settings,
        deforming: Collection[str],
        words: Sequence[str],
        held: Mapping[str, str],
        unwatched: Collection[int],
    ) -> String:
        """Return the message.

        Args:
            settings: the settings in force.
            deforming: the bodies that have received a new shape.
            words: the texts for which ~/pairs has numbers.
            held: the parent's name by the child's, for attached bodies that are carried now.
            unwatched: the indices of pairs that are not watched because of these attachments.
        """
        scene, thresholds = self._scene, settings.thresholds
        path, unit = scene.path, scene.unit
        told = {
            "name": path.parent.name if path.name == "scene.yaml" else path.stem,
            "path": str(path),
            "description": scene.description,
            "frame": settings.frame,
            "unit": {"symbol": unit.symbol, "to_metre": unit.to_metre},
            "bodies": [
                body if settings.body_topics else body | {"topic": None} for body in self._bodies
            ],
            "checksum": self._checksum,
            "words": list(words),
            "deforming": sorted(deforming),
            "pairs": len(scene.pairs),
            "thresholds": _keys(
                scene.thresholds if self._common is None else thresholds[self._common]
            ),
            "own_thresholds": [
                {"a": scene.pairs[i].a, "b": scene.pairs[i].b, **_keys(thresholds[i])}
                for i in self._own
            ],
            "attachments": dict(settings.attachments),
            "held": dict(held),
            "unwatched": [[scene.pairs[i].a, scene.pairs[i].b] for i in unwatched],
            "own_parameters": len(self._own) <= MAX_PAIRS,
            "settings": {
                "rate_hz": settings.rate_hz,
                "budget_ms": settings.budget_s * 1e3,
                "rel_err": settings.rel_err,
                "abs_err": settings.abs_err,
                "pose_timeout_s": settings.pose_timeout_s,
            },
        }
        return String(data=json.dumps(told))


def _body(
    body: Body, model: engine.Model, full_name: Callable[[str], str], least: float
) -> dict[str, Any]:
    """Return the entry of a body; `least` is the smallest range of its pairs, metres."""
    pose = None
    if body.pose is not None:
        x, y, z, w = to_quaternion(body.pose[:3, :3])
        pose = [*body.pose[:3, 3].tolist(), w, x, y, z]
    return {
        "name": body.name,
        "moving": body.moving,
        # A reader may have another namespace, and other names for topics.
        "topic": None if body.topic is None else full_name(body.topic),
        "point": isinstance(body.primitive, Point),
        "mesh": model.digest(),
        "colour": list(body.colour),
        "pose": pose,
        "range": least if math.isfinite(least) else None,
    }


def _keys(thresholds: Thresholds) -> dict[str, float]:
    return {"warn": thresholds.warn, "stop": thresholds.stop, "hysteresis": thresholds.hysteresis}

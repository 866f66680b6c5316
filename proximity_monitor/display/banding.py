"""Colours parts by clearance, if a person has chosen that for them; see `bands`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from typing import NamedTuple

import numpy as np
import viser

from proximity_monitor.display import bands
from proximity_monitor.display.part_view import Coat
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.received import Part
from proximity_monitor.display.signs import CLEAR_SIGN, STALE_SIGN, STOP_SIGN, WARN_SIGN, length
from proximity_monitor.display.state import STALE, Frame, SceneInfo

EVERY_S = 0.5
"""Minimum seconds between the starts of two computations of bands."""

LONGEST_S = 5.0
"""Maximum seconds for the bands of one part; the time grows up to this while nothing near moves."""

COLOURS = ((213, 94, 0), (230, 159, 0), (86, 180, 233), (150, 150, 155))
"""By band: below stop, below warn, above, not known. They differ in lightness as well as in hue."""

_ALWAYS_SEEN = (bands.BELOW_STOP, bands.BELOW_WARN)
"""Bands that are opaque even on a transparent part."""

_WORDS = ("below stop", "below warn", "above", "not known yet")
_SIGNS = (STOP_SIGN, WARN_SIGN, CLEAR_SIGN, STALE_SIGN)

_WORKER = ThreadPoolExecutor(1, thread_name_prefix="bands")
"""One thread for all browsers, so that the page's own thread keeps its time."""


_Placed = tuple[Part, bytes | None]

_Near = tuple[_Placed, tuple]
"""A part with its pose, and for each of its listed pairs: the other part, its pose, whether it is a
point, and the thresholds. A pose is None if it is unknown at that tick or too old."""


class _Job(NamedTuple):
    name: str
    near: _Near
    stamp_s: float
    budget_s: float
    answer: Future


class Banding:
    """The coloured meshes of one page."""

    def __init__(self, api: viser.SceneApi, parts: Parts, scene: SceneInfo) -> None:
        """Begin without coloured parts."""
        self._api = api
        self._parts = parts
        self._scene = scene
        self._number = {body.name: i for i, body in enumerate(scene.bodies)}
        self._row = {name: i for i, name in enumerate(scene.moving)}
        self._seen: tuple = ()
        self._near: dict[str, _Near] = {}  # by part, of the tick that was shown last
        self._made: dict[str, tuple[_Near | None, float]] = {}  # input and tick of the shown bands
        self._job: _Job | None = None
        self._again: dict[str, tuple[_Near, float]] = {}  # input to compute again, and its budget
        self._due_s = 0.0
        self._behind_s = 0.0
        # By part: how far along it a colour may be wrong, and how far the shapes may be off.
        self._sampled_m: dict[str, tuple[float, float]] = {}

    def show(
        self,
        scene: SceneInfo,
        frame: Frame,
        parts: Sequence[Part],
        wanted: Sequence[str],
        now_s: float,
        past: bool = False,
    ) -> None:
        """Colour the wanted parts one after the other, and no other parts.

        Args:
            scene: the scene, with the thresholds in force.
            frame: the tick that is shown.
            parts: the parts with their present shapes.
            wanted: names of the parts to colour.
            now_s: a moment of a clock that never goes back.
            past: whether the tick is in the past; deforming bodies had another shape then.
        """
        self._scene = scene
        for name in self._made.keys() - set(wanted):
            del self._made[name], self._sampled_m[name]
            self._parts[name].coat(self._api, ())
        if self._job is not None and self._job.answer.done():
            job, self._job = self._job, None
            if job.name in wanted:
                self._draw(job)
        seen = frame, scene, parts, tuple(wanted), past
        if seen != self._seen:  # once a tick, not at every step of the page
            self._seen, changed = seen, scene.deforming if past else frozenset()
            placed = cache(lambda name: self._placed(name, frame, parts))
            self._near = {name: self._near_of(name, frame, placed, changed) for name in wanted}
        near = self._near
        old = [n for n in wanted if n not in self._made or self._made[n][0] != near[n]]
        since = [frame.stamp_s - self._made[name][1] for name in old if name in self._made]
        self._behind_s = max(since, key=abs, default=0.0)  # negative while the page looks back
        if self._job is None and old and now_s >= self._due_s:
            self._due_s = now_s + EVERY_S
            name = min(old, key=lambda each: self._made[each][1] if each in self._made else -np.inf)
            of, more_s = self._again.get(name, (None, 0.0))
            budget_s = more_s if of == near[name] else bands.BUDGET_S
            answer = _WORKER.submit(_bands, near[name], budget_s)
            self._job = _Job(name, near[name], frame.stamp_s, budget_s, answer)

    def legend(self) -> str:
        """Return what the colours mean, as HTML; empty if no part is coloured."""
        if not self._made and self._job is None:
            return ""
        boxes = "".join(
            f"<span style='background:rgb{colour};padding:0 6px'>{shown.glyph}</span> {word} "
            for colour, word, shown in zip(COLOURS, _WORDS, _SIGNS, strict=True)
        )
        where = "behind" if self._behind_s > 0.0 else "after the moment that is shown"
        late = f"; {abs(self._behind_s):.1f} s {where}" if self._behind_s else ""
        sampled, deviation = np.array(list(self._sampled_m.values()) or [(0.0, 0.0)]).max(axis=0)
        unit, told = self._scene.unit, []
        if sampled > 0.0:
            told.append(f"colours off by up to {length(sampled, unit)} along a part")
        if np.isinf(deviation):
            told.append("it is unknown how far the drawing is off")
        elif deviation > 0.0:
            told.append(f"the drawing is up to {length(deviation, unit)} off the shapes")
        exact = "; ".join(told) or "certain"
        return f'<div class="pm pm-small" id="pm-bands">{boxes}<br>{exact}{late}</div>'

    def _near_of(
        self, name: str, frame: Frame, placed: Callable[[str], _Placed], changed: Collection[str]
    ) -> _Near:
        """Return all that a part's bands depend on: itself and the other part of each listed pair.

        A pose is None, so the bands are unknown, if the pair is stale, if the tick holds one pair
        alone, or if a part had another shape at that tick.
        """
        part, pose = placed(name)
        if not frame.whole or name in changed:
            return (part, None), ()
        others, pairs = [], frame.pairs
        for row in pairs.rows_of.get(name, ()):
            pair = pairs.names[row]
            other = pair[1] if pair[0] == name else pair[0]
            point = self._scene.bodies[self._number[other]].point
            there, at = placed(other)
            known = pairs.level[row] != STALE and other not in changed
            thresholds = self._scene.thresholds_of(pair)
            others.append((there, at if known else None, point, thresholds))
        return (part, pose), tuple(others)

    def _placed(self, name: str, frame: Frame, parts: Sequence[Part]) -> _Placed:
        """Return a part and its pose, as bytes so that poses can be compared."""
        part = parts[self._number[name]]
        row = self._row.get(name)
        pose = part.pose if row is None else frame.pose(row)
        return part, None if pose is None else pose.tobytes()

    def _draw(self, job: _Job) -> None:
        # The page shows an error of the computation.
        corners, of, *errors, cut = job.answer.result()
        self._sampled_m[job.name] = tuple(errors)
        scale = self._parts.scale
        # If time ran out, as on a busy machine, the bands are computed again with a larger budget.
        again = cut and (job.budget_s < LONGEST_S or bool((of == bands.UNKNOWN).any()))
        self._made[job.name] = (None if again else job.near, job.stamp_s)
        self._again.pop(job.name, None)
        if again:
            self._again[job.name] = job.near, min(2.0 * job.budget_s, LONGEST_S)
        coats = [
            Coat(corners[of == band].reshape(-1, 3) * scale, colour, band in _ALWAYS_SEEN)
            for band, colour in enumerate(COLOURS)
        ]
        self._parts[job.name].coat(self._api, coats if len(corners) else ())


def _is_placed(near: _Near) -> bool:
    (_, own), others = near
    return own is not None and all(pose is not None for _, pose, _, _ in others)


def _bands(near: _Near, budget_s: float) -> bands.Bands:
    (part, own), others = near
    corners = part.corners.reshape(-1, 3, 3)
    if not _is_placed(near):
        return bands.Bands(corners, np.full(len(corners), bands.UNKNOWN), 0.0, 0.0)
    inverse = np.linalg.inv(bands.matrix(np.frombuffer(own)))
    told = [
        bands.Other(
            bands.model_of(other, point),
            inverse @ bands.matrix(np.frombuffer(pose)),
            thresholds,
            other.deviation,
        )
        for other, pose, point, thresholds in others
    ]
    return bands.bands(corners, told, budget_s, part.deviation)

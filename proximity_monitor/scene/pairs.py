"""The `pairs` section: which bodies to watch, and each pair's question, range and limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from proximity_monitor.scene.description import Body, Thresholds, Unit
from proximity_monitor.scene.naming import EVERYTHING
from proximity_monitor.scene.report import Keys, Report
from proximity_monitor.scene.robots import Robots
from proximity_monitor.scene.watch import CONTACT, UNWATCHED, PairSettings, WatchedPairs

_ROUNDED = 1e-12
"""Relative rounding error of a sum of two lengths that are converted from another unit."""


def read_settings(
    data: Mapping[str, Any], keys: Keys, defaults: PairSettings, unit: Unit, report: Report
) -> PairSettings:
    """Return the settings that the file gives; the others are those of `defaults`."""
    tolerance = data.get("tolerance", {})
    question = data.get("question", defaults.question)
    given = {
        key: float(value) if key == "hold_s" else unit.to_metre * value
        for key, value in data.get("thresholds", {}).items()
    }
    thresholds = Thresholds(**{**vars(defaults.thresholds), **given})
    if question == "collide":
        thresholds = CONTACT
        if given:
            report.add(
                (*keys, "thresholds"),
                "have no effect with 'question: collide', which alerts only on contact; remove "
                "them, or set 'question: within'",
            )
    limits = PairSettings(
        rel_err=float(tolerance.get("rel_err", defaults.rel_err)),
        abs_err=unit.to_metre * tolerance["abs_err"]
        if "abs_err" in tolerance
        else defaults.abs_err,
        thresholds=thresholds,
        own_thresholds=bool(given) or question == "collide",
        question=question,
        range=unit.to_metre * data["range"] if "range" in data else defaults.range,
    )
    _check(limits, "range" if "range" in data else "thresholds", keys, unit, report)
    # Lengths that are equal in the file may differ after their conversion to metres.
    least = thresholds.warn + thresholds.hysteresis
    return replace(limits, range=max(limits.range, least))


def _check(limits: PairSettings, key: str, keys: Keys, unit: Unit, report: Report) -> None:
    """Report settings that contradict each other; `key` is the key that the file gives of them."""
    thresholds = limits.thresholds
    warn, stop, least, most = (
        value / unit.to_metre
        for value in (
            thresholds.warn,
            thresholds.stop,
            thresholds.warn + thresholds.hysteresis,
            limits.range,
        )
    )
    if warn < stop:
        report.add(
            (*keys, "thresholds"),
            f"warn must not be less than stop (got warn {warn:g}, stop {stop:g} {unit.symbol})",
        )
    if most < least * (1.0 - _ROUNDED):
        report.add(
            (*keys, key),
            f"range must not be less than warn + hysteresis, or alerts would be missed (got range "
            f"{most:g}, warn + hysteresis {least:g} {unit.symbol})",
        )


def read_pairs(
    section: Mapping[str, Any] | str,
    bodies: tuple[Body, ...],
    defaults: PairSettings,
    unit: Unit,
    report: Report,
    robots: Robots,
    assemblies: Mapping[str, list[str]],
) -> WatchedPairs:
    """Make the watched pairs; their problems go to the report."""
    if isinstance(section, str):  # "all"
        section = {}
    names = _Names(bodies, section.get("groups", {}), assemblies, robots.groups, report)
    kinds, rule, exceptions = [defaults], 0, []
    if "watch" in section:
        rule = UNWATCHED
        for index, entry in enumerate(section["watch"]):
            keys = ("pairs", "watch", index)
            kind = len(kinds)
            kinds.append(read_settings(entry, keys, defaults, unit, report))
            if names.mean_everything(entry["between"]):
                rule, exceptions = kind, []
            else:
                exceptions.append(_of_kind(names.watched(entry["between"], keys), kind))
    for index, entry in enumerate(section.get("exclude", ())):
        pairs = names.between(entry, ("pairs", "exclude", index))
        exceptions.append(_of_kind(pairs, UNWATCHED))
    apart = [names.pair(*pair) for pair in robots.excluded]
    exceptions.append(_of_kind(np.array(apart, np.int64).reshape(-1, 2), UNWATCHED))
    pairs = WatchedPairs(
        [body.name for body in bodies],
        [body.moving or body.deforming for body in bodies],
        kinds,
        rule,
        names.last(exceptions),
    )
    if not pairs:
        report.add(
            ("pairs",),
            "leaves no pair to watch; a pair needs two bodies, and at least one must move",
        )
    return pairs


def _of_kind(pairs: np.ndarray, kind: int) -> np.ndarray:
    """Return pairs (k, 2) as exceptions (k, 3): two bodies and a kind."""
    return np.column_stack((pairs, np.full(len(pairs), kind)))


class _Names:
    """Finds bodies and groups by name. A pair is two body indices, the lower one first."""

    def __init__(
        self,
        bodies: tuple[Body, ...],
        groups: Mapping[str, list[str]],
        assemblies: Mapping[str, list[str]],
        robots: Mapping[str, list[str]],
        report: Report,
    ) -> None:
        self._moving = np.array([body.moving or body.deforming for body in bodies], dtype=bool)
        self._report = report
        self._members = {body.name: [index] for index, body in enumerate(bodies)}
        self._single = single = dict(self._members)
        for whole, names in {**assemblies, **robots}.items():
            self._members[whole] = [index for name in names for index in single.get(name, ())]
        for group, names in groups.items():
            keys = ("pairs", "groups", group)
            if group in self._members:
                what = "a robot" if group in robots else "an assembly"
                what = "a body" if group in single else what
                report.add(keys, f"'{group}' is {what}; give the group another name")
                continue
            members = [self._find(name, single, (*keys, at)) for at, name in enumerate(names)]
            self._members[group] = [index for found in members for index in found]
        self._named_so = EVERYTHING in self._members
        self._members.setdefault(EVERYTHING, list(range(len(bodies))))

    def mean_everything(self, two: list[str]) -> bool:
        """Return whether an entry means every pair of the scene."""
        return two == [EVERYTHING, EVERYTHING] and not self._named_so

    def watched(self, two: list[str], keys: Keys) -> np.ndarray:
        """Return the pairs of an entry whose clearance can change; report it if there are none."""
        pairs = self.between(two, (*keys, "between"))
        moving = self._changing(pairs)
        if len(pairs) and not len(moving):
            self._report.add(
                (*keys, "between"),
                f"'{two[0]}' and '{two[1]}' are fixed, so their clearance never changes; "
                "watch a moving body, or remove this entry",
            )
        return moving

    def between(self, two: list[str], keys: Keys) -> np.ndarray:
        """Return all pairs (k, 2) of one body from each name; no body is paired with itself."""
        left, right = (self._find(name, self._members, (*keys, at)) for at, name in enumerate(two))
        a, b = (each.ravel() for each in np.meshgrid(left, right, indexing="ij"))
        pairs = np.stack((np.minimum(a, b), np.maximum(a, b)), axis=1).astype(np.int64)
        pairs = pairs[pairs[:, 0] != pairs[:, 1]]
        if left and right and not len(pairs):
            self._report.add(keys, f"'{two[0]}' and '{two[1]}' are the same body; name two bodies")
        return pairs

    def pair(self, a: str, b: str) -> tuple[int, int]:
        """Return the pair of two bodies, given by name."""
        (i,), (j,) = self._single[a], self._single[b]
        return min(i, j), max(i, j)

    def last(self, exceptions: Sequence[np.ndarray]) -> np.ndarray:
        """Return the last exception (k, 3) about each pair whose clearance can change."""
        every = np.concatenate(exceptions)[::-1]
        every = self._changing(every)
        _, first = np.unique(every[:, 0] * len(self._moving) + every[:, 1], return_index=True)
        return every[first]

    def _changing(self, pairs: np.ndarray) -> np.ndarray:
        """Return the given pairs without those of two fixed bodies."""
        return pairs[self._moving[pairs[:, 0]] | self._moving[pairs[:, 1]]]

    def _find(self, name: str, known: Mapping[str, list[int]], keys: Keys) -> list[int]:
        if name not in known:
            self._report.add(keys, f"nothing is named '{name}'", (name, known))
        return known.get(name, [])

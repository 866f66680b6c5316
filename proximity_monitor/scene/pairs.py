"""The `pairs` section: which bodies to watch, and each pair's tolerance and thresholds."""

from __future__ import annotations

import difflib
import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from proximity_monitor.scene.description import Body, Thresholds, Unit, WatchedPair
from proximity_monitor.scene.report import Keys, Report

_CONTACT = Thresholds(warn=0.0, stop=0.0, hysteresis=0.0)


@dataclass(frozen=True)
class Limits:
    """What a pair is watched with: errors and thresholds, in metres."""

    rel_err: float = 0.0
    abs_err: float = 0.0
    thresholds: Thresholds = _CONTACT
    own_thresholds: bool = False


def read_limits(
    data: Mapping[str, Any], keys: Keys, defaults: Limits, unit: Unit, report: Report
) -> Limits:
    """Read `tolerance` and `thresholds` where they stand; the rest is taken from the defaults."""
    tolerance = data.get("tolerance", {})
    given = {key: unit.to_metre * value for key, value in data.get("thresholds", {}).items()}
    thresholds = Thresholds(**{**vars(defaults.thresholds), **given})
    if thresholds.warn < thresholds.stop:
        warn, stop = (value / unit.to_metre for value in (thresholds.warn, thresholds.stop))
        report.add(
            (*keys, "thresholds"),
            f"warn must not be less than stop (got warn {warn:g}, stop {stop:g} {unit.symbol})",
        )
    return Limits(
        rel_err=float(tolerance.get("rel_err", defaults.rel_err)),
        abs_err=unit.to_metre * tolerance["abs_err"]
        if "abs_err" in tolerance
        else defaults.abs_err,
        thresholds=thresholds,
        own_thresholds=bool(given),
    )


def read_pairs(
    section: Mapping[str, Any] | str,
    bodies: tuple[Body, ...],
    defaults: Limits,
    unit: Unit,
    report: Report,
) -> tuple[WatchedPair, ...]:
    """Make the watched pairs; what is wrong with them goes to the report."""
    if isinstance(section, str):  # "all"
        section = {}
    names = _Names(bodies, section.get("groups", {}), report)
    if "watch" in section:
        chosen: dict[tuple[int, int], Limits] = {}
        for index, entry in enumerate(section["watch"]):
            keys = ("pairs", "watch", index)
            limits = read_limits(entry, keys, defaults, unit, report)
            chosen.update(dict.fromkeys(names.watched(entry["between"], keys), limits))
    else:
        chosen = dict.fromkeys(
            names.moving(itertools.combinations(range(len(bodies)), 2)), defaults
        )
    for index, entry in enumerate(section.get("exclude", ())):
        for pair in names.between(entry, ("pairs", "exclude", index)):
            chosen.pop(pair, None)
    if not chosen:
        report.add(
            ("pairs",),
            "leaves no pair to watch; a pair needs two bodies, and one of them moving",
        )
    return tuple(
        WatchedPair(
            bodies[a].name,
            bodies[b].name,
            limits.rel_err,
            limits.abs_err,
            limits.thresholds,
            limits.own_thresholds,
        )
        for (a, b), limits in sorted(chosen.items(), key=lambda item: item[0])
    )


class _Names:
    """Bodies and groups by name; pairs are index pairs with the lower index first."""

    def __init__(
        self, bodies: tuple[Body, ...], groups: Mapping[str, list[str]], report: Report
    ) -> None:
        self._bodies = bodies
        self._report = report
        self._members = {body.name: [index] for index, body in enumerate(bodies)}
        single = dict(self._members)
        for group, names in groups.items():
            keys = ("pairs", "groups", group)
            if group in single:
                report.add(keys, f"'{group}' is a body; give the group another name")
                continue
            members = [self._find(name, single, (*keys, at)) for at, name in enumerate(names)]
            self._members[group] = [index for found in members for index in found]

    def watched(self, two: list[str], keys: Keys) -> list[tuple[int, int]]:
        """The pairs of an entry that can change; none at all is a mistake in the file."""
        pairs = self.between(two, (*keys, "between"))
        moving = list(self.moving(pairs))
        if pairs and not moving:
            self._report.add(
                (*keys, "between"),
                f"'{two[0]}' and '{two[1]}' are fixed, so their clearance never changes; "
                "watch a moving body, or remove this entry",
            )
        return moving

    def moving(self, pairs: Iterable[tuple[int, int]]) -> Iterable[tuple[int, int]]:
        """Leave out pairs of two fixed bodies."""
        return (pair for pair in pairs if any(self._bodies[index].moving for index in pair))

    def between(self, two: list[str], keys: Keys) -> list[tuple[int, int]]:
        """All pairs of one body of each name, without bodies against themselves."""
        left, right = (self._find(name, self._members, (*keys, at)) for at, name in enumerate(two))
        pairs = {(min(pair), max(pair)) for pair in itertools.product(left, right)}
        pairs = sorted(pair for pair in pairs if pair[0] != pair[1])
        if left and right and not pairs:
            self._report.add(keys, f"'{two[0]}' and '{two[1]}' are one body; name two")
        return pairs

    def _find(self, name: str, known: Mapping[str, list[int]], keys: Keys) -> list[int]:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean '{near[0]}'?" if near else f"known are {', '.join(known)}"
            self._report.add(keys, f"nothing is named '{name}'; {hint}")
        return known.get(name, [])

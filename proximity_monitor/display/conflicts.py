"""What people decided about conflicts: new, accepted or ignored, with a comment.

A decision is a note. It changes no state, no alert and no number. The file is read again before
each write, so entries that others wrote stay. Decisions that cannot be written now are kept in
memory, and the next look tries again.
"""

from __future__ import annotations

import threading
from contextlib import suppress
from datetime import UTC, datetime
from html import escape
from pathlib import Path

from proximity_monitor.display import decisions
from proximity_monitor.display.choice import PairName
from proximity_monitor.display.decisions import NEW, Decision, Decisions, Unsaved
from proximity_monitor.display.order import kind_of
from proximity_monitor.display.signs import length
from proximity_monitor.display.state import Pairs, SceneInfo, Unit

LOOK_S = 1.0
"""Seconds between two looks at the file."""

UNDECIDED = Decision()


class DecisionStore:
    """The decisions of one scene, for all browsers."""

    def __init__(self, given: str = "") -> None:
        """Begin without a scene; call `follow` before anything else.

        Args:
            given: path of the file; empty: `decisions.place` chooses it.
        """
        self._given = given
        self._lock = threading.Lock()
        self._where: tuple[str, str] | None = None  # the scene's file and name
        self._unsaved: Unsaved = {}
        self._waiting: dict[tuple[str, str], Unsaved] = {}  # unsaved decisions of other scenes
        self._known: Decisions = {}
        self._seen: object = self  # differs from every result of `_look`
        self._due_s = float("-inf")
        self.path: Path | None = None
        """The file of decisions; None: there is no place for one."""
        self.problem = ""
        """Why the file cannot be read or written now; empty if it can."""

    @property
    def all(self) -> Decisions:
        """All decisions, including those that are not written yet."""
        return self._known | {key: told for key, (_, told) in self._unsaved.items()}

    def is_written(self, pair: PairName) -> bool:
        """Return whether the decision about a pair is in the file; also true if there is none."""
        return frozenset(pair) not in self._unsaved

    def decide(self, pair: PairName, decision: Decision) -> None:
        """Take a decision; `follow` writes it. Any thread may call this."""
        with self._lock:
            self._unsaved = {**self._unsaved, frozenset(pair): (pair, decision)}
            self._due_s = float("-inf")

    def follow(self, scene: SceneInfo, now_s: float) -> None:
        """Write new decisions to the file; every `LOOK_S`, read new ones from it."""
        if self._where != (scene.path, scene.name):
            self._begin(scene)
        if self.path is None or now_s < self._due_s:
            return
        with self._lock:
            unsaved, self._due_s = self._unsaved, now_s + LOOK_S
        try:
            if unsaved:
                self._write(unsaved, scene.name)
                self._seen = self
            if (seen := _look(self.path)) != self._seen:
                self._known, self._seen = decisions.decisions(decisions.read(self.path)), seen
            with self._lock:
                left = self._unsaved.items() - unsaved.items()
                self._unsaved = dict(left)
            self.problem = ""
        except (OSError, ValueError) as error:
            self.problem = _problem(error, self.path, bool(unsaved))

    def _write(self, unsaved: Unsaved, scene: str) -> None:
        with decisions.alone(self.path):
            told = decisions.merged(decisions.read(self.path), unsaved, scene)
            decisions.write(self.path, told)

    def _begin(self, scene: SceneInfo) -> None:
        if self._unsaved and self.path is not None:
            # Decisions that cannot be written wait until their scene comes back.
            with suppress(OSError, ValueError), self._lock:
                self._write(self._unsaved, self._where[1])
                self._unsaved = {}
        with self._lock:
            if self._where is not None:
                self._waiting[self._where] = self._unsaved
            self._where = (scene.path, scene.name)
            self._unsaved = self._waiting.pop(self._where, {})
        self._known, self._seen, self._due_s = {}, self, float("-inf")
        self.path, self.problem = decisions.place(scene, self._given)


def _look(path: Path) -> tuple[int, ...] | None:
    """Return values that change whenever the file is written; None: there is no file."""
    try:
        found = path.stat()
    except FileNotFoundError:
        return None
    return found.st_ino, found.st_size, found.st_mtime_ns


def _problem(error: Exception, path: Path, unsaved: bool) -> str:
    why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    kept = " Later decisions are kept in memory until it can be written." if unsaved else ""
    return f"{path}: {why}. The file is unchanged.{kept}"


def decision_now(
    pairs: Pairs,
    row: int | None,
    status: str,
    comment: str,
    camera: tuple[float, ...] | None = None,
) -> Decision:
    """Return a person's decision of this moment, with the pair's state and bounds.

    Args:
        pairs: the pairs of the tick.
        row: the pair's row in it; None if the tick does not list the pair.
        status: one of `decisions.STATUSES`.
        comment: the person's own words.
        camera: the person's camera; see `Decision.camera`.
    """
    now = datetime.now(UTC).isoformat(timespec="seconds")
    if camera is not None and not decisions.is_camera(camera):
        camera = None
    if row is None:
        return Decision(status, comment, decided=now, camera=camera)
    bounds = (float(x) for x in (pairs.lower[row], pairs.upper[row]))
    known = (x if abs(x) <= decisions.FAR_M else None for x in bounds)
    return Decision(status, comment, kind_of(pairs, row), *known, now, camera)


def decision_line(
    decision: Decision, state: str, upper: float, unit: Unit, worse: str = "worse now"
) -> str:
    """Return a decision as one line for people; empty if there is no decision.

    Args:
        decision: the decision about a pair.
        state: the pair's state, one of `order.KINDS`.
        upper: the pair's upper bound, metres.
        unit: the unit for bounds.
        worse: the words to add if the pair is worse than when the decision was made.
    """
    if decision == UNDECIDED:
        return ""
    known = decision.upper is not None and decision.status != NEW
    at = f" at {length(decision.upper, unit)}" if known else ""
    outgrown = f" as {decision.state}, and {worse}" if decision.outgrown(state, upper) else ""
    comment = f": {decision.comment}" if decision.comment else ""
    return f"{decision.status}{at}{outgrown}{comment}"


def row_mark(
    decision: Decision, state: str, upper: float, unit: Unit, worse: str = "worse now"
) -> str:
    """Return a decision as HTML for the row of its pair; see `decision_line`."""
    kind = "pm-unproved" if decision.outgrown(state, upper) else "pm-dim"
    line = escape(decision_line(decision, state, upper, unit, worse))
    return f'<div class="pm-small pm-decided {kind}">{line}</div>' if line else ""

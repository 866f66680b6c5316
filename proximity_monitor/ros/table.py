"""The demo's picture of a running monitor, made from its topics."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rich.console import Group
from rich.table import Table
from rich.text import Text

from proximity_monitor.scene import Unit
from proximity_monitor.scene.naming import counted

_STYLES = {"stop": "bold red", "warn": "bold yellow", "stale": "bold magenta", "clear": "green"}
"""The states of pairs, the most urgent first."""
_COLUMNS = ("pair", "clearance", "status", "state", "session minimum")
_LENGTHS = (1, 4)
_ALERTS = 3
"""How many of the last alerts are shown live, and how many of each kind in the summary."""


@dataclass
class Picture:
    """The last messages of a monitor, as text."""

    unit: Unit
    what_runs: str
    results: int = 0
    """How many messages of ~/closest_points came, read or not."""
    alerts: list[DiagnosticStatus] = field(default_factory=list)
    _pairs: list[DiagnosticStatus] = field(default_factory=list)
    _least: dict[str, float] = field(default_factory=dict)
    _clearance: dict[str, str] = field(default_factory=dict)
    _schedule: dict[str, str] = field(default_factory=dict)
    _troubles: dict[str, str] = field(default_factory=dict)
    _silent: str = ""
    """Bodies that were silent at the last diagnostics."""

    @property
    def ready(self) -> bool:
        """Whether there is something to show: results and their rate."""
        return bool(self.results) and self._schedule.get("rate_achieved_hz", "nan") != "nan"

    def take_points(self, message: DiagnosticArray) -> None:
        """Keep a message of ~/closest_points."""
        self._pairs = message.status
        for status in message.status:
            least = next(each.value for each in status.values if each.key == "session_min_m")
            self._least[status.name] = float(least)

    def take_alert(self, message: DiagnosticStatus) -> None:
        """Keep a message of ~/alerts."""
        self.alerts.append(message)

    def take_diagnostics(self, message: DiagnosticArray) -> None:
        """Keep the monitor's part of a message of /diagnostics."""
        for status in message.status:
            _, _, task = status.name.rpartition(": ")
            if task == "clearance":
                self._clearance = _values(status)
            if task == "schedule":
                self._schedule = _values(status)
            if task == "inputs":
                self._silent = _values(status)["silent bodies"]
            if task in ("schedule", "inputs"):
                self._troubles[task] = status.message if status.level != DiagnosticStatus.OK else ""

    def header(self) -> str:
        """Return one line: rate, times, use of the budget, alerts."""
        if not self.ready:
            return f"{self.what_runs}; waiting for the first diagnostics"
        told = self._schedule
        budget_ms = float(told["budget_ms"])
        use = f"{float(told['search_p50_ms']) / budget_ms:.0%} of {budget_ms:g} ms"
        return (
            f"{told['rate_achieved_hz']} Hz; search p50 {told['search_p50_ms']}, p99"
            f" {told['search_p99_ms']} ms ({use if budget_ms else 'no budget'}); whole tick p99"
            f" {told['tick_p99_ms']} ms; alerts {len(self.alerts)}"
        )

    def count(self) -> str:
        """Return one line: how many pairs there are, and the states of the listed pairs."""
        listed = Counter(_values(status)["state"] for status in self._pairs)
        states = ", ".join(f"{listed[state]} {state}" for state in _STYLES if listed[state])
        if not self._clearance:
            return f"{counted(len(self._pairs), 'pair', 'pairs')} listed: {states or 'none'}"
        watched = counted(int(self._clearance["pairs watched"]), "pair", "pairs")
        beyond = self._clearance["pairs beyond range"]
        whose = "its" if beyond == "1" else "their"
        far = f"{beyond} beyond {whose} range" if beyond not in ("0", "nan") else ""
        return f"{watched}: {', '.join(filter(None, (states, far)))}"

    def rows(self, limit: int) -> list[tuple[str, ...]]:
        """Return the texts of the columns for the pairs that may be nearest, the nearest first.

        Args:
            limit: how many pairs at most. Pairs without a pose come last.
        """
        told = [(status.name, _values(status)) for status in self._pairs]
        told.sort(key=_nearness)
        return [
            (
                name,
                self._clearance_text(values),
                values["status"],
                values["state"],
                self._length(values["session_min_m"]),
            )
            for name, values in told[:limit]
        ]

    def changes(self) -> list[str]:
        """Return a line for each kind of alert: how many there were, for which pairs, and why.

        Only the last few pairs are named, each once.
        """
        kinds: dict[str, list[DiagnosticStatus]] = {}
        for alert in self.alerts:
            kinds.setdefault(alert.message.partition(":")[0], []).append(alert)
        lines = []
        for kind, alerts in sorted(kinds.items()):
            why = {alert.name: alert.message.partition(": ")[2] for alert in alerts}
            told = [f"{name} ({reason})" for name, reason in why.items()][-_ALERTS:]
            more = len(why) - len(told)
            also = f", and {counted(more, 'other pair', 'other pairs')}" if more else ""
            lines.append(f"{len(alerts)} x {kind}: {', '.join(told)}{also}")
        return lines

    def minima(self, limit: int) -> list[tuple[str, str]]:
        """Return the smallest clearances of the session with their pairs, the smallest first."""
        known = [(least, name) for name, least in self._least.items() if least < math.inf]
        return [(name, self._length(least)) for least, name in sorted(known)[:limit]]

    def plain(self, limit: int) -> str:
        """Return the picture as lines, with at most `limit` pairs."""
        rows = [tuple(self._titles()), *self.rows(limit)]
        widths = [max(len(row[i]) for row in rows) for i in range(len(_COLUMNS))]
        lines = [
            "  " + "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True))
            for row in rows
        ]
        head = [self.header(), self.count(), *self._warnings()]
        return "\n".join([*head, *(line.rstrip() for line in lines), *self._rest(limit)])

    def rich(self, height: int) -> Group:
        """Return the picture for a terminal of `height` lines."""
        head = [Text(self.what_runs, style="dim"), Text(self.header()), Text(self.count())]
        head += [Text(line, style="yellow") for line in self._warnings()]
        last = [Text(f"{a.name}: {a.message}", style="dim") for a in self.alerts[-_ALERTS:]]
        # Four lines: titles, the line beneath them, the line about further pairs, the cursor's.
        limit = max(height - len(head) - len(last) - 4, 1)
        table = Table(show_edge=False, pad_edge=False)
        for i, title in enumerate(self._titles()):
            table.add_column(title, justify="right" if i in _LENGTHS else "left", no_wrap=True)
        for row in self.rows(limit):
            *before, state, least = row
            table.add_row(*before, Text(state, style=_STYLES[state]), least)
        rest = [Text(line, style="dim") for line in self._rest(limit)]
        return Group(*head, table, *rest, *last)

    def _clearance_text(self, values: Mapping[str, str]) -> str:
        lower, upper = self._length(values["lower_m"]), self._length(values["upper_m"])
        if values["status"] in ("exact", "within tolerance") or lower == upper:
            return upper
        return f"above {lower}" if upper == "inf" else f"{lower}..{upper}"

    def _length(self, metres: float | str) -> str:
        return f"{float(metres) / self.unit.to_metre:.4f}"

    def _titles(self) -> list[str]:
        return [
            f"{title} [{self.unit.symbol}]" if i in _LENGTHS else title
            for i, title in enumerate(_COLUMNS)
        ]

    def _rest(self, limit: int) -> list[str]:
        more = len(self._pairs) - limit
        if more <= 0:
            return []
        return [f"  and {counted(more, 'more pair, not', 'more pairs, none of them')} nearer"]

    def _warnings(self) -> list[str]:
        """Return the diagnostics' warnings, which are up to a second older than the pairs."""
        heard = self._silent and all(_values(pair)["state"] != "stale" for pair in self._pairs)
        return [
            f"{task}: {text}"
            for task, text in self._troubles.items()
            if text and not (task == "inputs" and heard)
        ]


def _values(status: DiagnosticStatus) -> dict[str, str]:
    return {each.key: each.value for each in status.values}


def _nearness(pair: tuple[str, Mapping[str, str]]) -> tuple[float, float, str]:
    """Return a sort key: the lower bound, then the upper bound, then the name."""
    name, values = pair
    lower, upper = float(values["lower_m"]), float(values["upper_m"])
    return (math.inf, math.inf, name) if math.isnan(lower) else (lower, upper, name)

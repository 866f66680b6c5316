"""The demo's picture of a running monitor, made from what it publishes."""

from __future__ import annotations

from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rich.console import Group
from rich.table import Table
from rich.text import Text

from proximity_monitor.scene import Unit

_STYLES = {"clear": "green", "warn": "bold yellow", "stop": "bold red", "stale": "bold magenta"}
_COLUMNS = ("pair", "clearance", "status", "state", "session minimum")


@dataclass
class Picture:
    """The last messages of a monitor, and how they read."""

    unit: Unit
    what_runs: str
    results: int = 0
    alerts: list[DiagnosticStatus] = field(default_factory=list)
    _pairs: list[DiagnosticStatus] = field(default_factory=list)
    _schedule: dict[str, str] = field(default_factory=dict)
    _troubles: dict[str, str] = field(default_factory=dict)

    def take_points(self, message: DiagnosticArray) -> None:
        """Keep a message of ~/closest_points."""
        self._pairs = message.status
        self.results += 1

    def take_alert(self, message: DiagnosticStatus) -> None:
        """Keep a message of ~/alerts."""
        self.alerts.append(message)

    def take_diagnostics(self, message: DiagnosticArray) -> None:
        """Keep what the monitor says about itself, of a message of /diagnostics."""
        for status in message.status:
            _, _, task = status.name.rpartition(": ")
            if task == "schedule":
                self._schedule = {each.key: each.value for each in status.values}
            if task in ("schedule", "inputs"):
                self._troubles[task] = status.message if status.level != DiagnosticStatus.OK else ""

    def header(self) -> str:
        """Return one line: rate, times, use of the budget, alerts."""
        if not self._schedule:
            return f"{self.what_runs}; waiting for the first diagnostics"
        told = self._schedule
        budget_ms = float(told["budget_ms"])
        use = f"{float(told['search_p50_ms']) / budget_ms:.0%} of {budget_ms:g} ms"
        return (
            f"{told['rate_achieved_hz']} Hz; search p50 {told['search_p50_ms']}, p99"
            f" {told['search_p99_ms']} ms ({use if budget_ms else 'no budget'}); whole tick p99"
            f" {told['tick_p99_ms']} ms; alerts {len(self.alerts)}"
        )

    def rows(self) -> list[tuple[str, ...]]:
        """Return the pairs in the scene's order, a text for each column."""
        rows = []
        for status in self._pairs:
            values = {each.key: each.value for each in status.values}
            lower, upper, least = (
                float(values[key]) / self.unit.to_metre
                for key in ("lower_m", "upper_m", "session_min_m")
            )
            exact = values["status"] not in ("bounded", "unknown pose")
            clearance = f"{upper:.4f}" if exact else f"{lower:.4f}..{upper:.4f}"
            rows.append((status.name, clearance, values["status"], values["state"], f"{least:.4f}"))
        return rows

    def plain(self) -> str:
        """Return the picture as lines."""
        rows = [tuple(self._titles()), *self.rows()]
        widths = [max(len(row[i]) for row in rows) for i in range(len(_COLUMNS))]
        lines = [
            "  " + "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True))
            for row in rows
        ]
        return "\n".join([self.header(), *self._warnings(), *(line.rstrip() for line in lines)])

    def rich(self) -> Group:
        """Return the picture for a terminal."""
        table = Table(show_edge=False, pad_edge=False)
        for i, title in enumerate(self._titles()):
            table.add_column(title, justify="right" if i in (1, 4) else "left", no_wrap=True)
        for row in self.rows():
            *before, state, least = row
            table.add_row(*before, Text(state, style=_STYLES[state]), least)
        lines = [Text(self.what_runs, style="dim"), Text(self.header())]
        lines += [Text(line, style="yellow") for line in self._warnings()]
        last = [Text(f"{a.name}: {a.message}", style="dim") for a in self.alerts[-3:]]
        return Group(*lines, table, *last)

    def _titles(self) -> list[str]:
        units = {1: f" [{self.unit.symbol}]", 4: f" [{self.unit.symbol}]"}
        return [title + units.get(i, "") for i, title in enumerate(_COLUMNS)]

    def _warnings(self) -> list[str]:
        return [f"{task}: {text}" for task, text in self._troubles.items() if text]

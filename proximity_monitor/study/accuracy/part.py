"""A part of the study: what it measures on which scenes, and how its data is drawn and told."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from matplotlib.figure import Figure

from proximity_monitor import engine

from ..scenes import StudyScene

Row = dict[str, str | int | float]
Rows = list[Row]


@dataclass(frozen=True)
class Job:
    """One scene of a part, to be measured.

    Attributes:
        name: the scene's name.
        scene: the models and poses to ask about.
        quick: whether few blocks of steps are enough.
        advance: called with the share of the job that was just done.
    """

    name: str
    scene: StudyScene
    quick: bool
    advance: Callable[[float], None]

    def models(self, **settings: str) -> dict[str, engine.Model]:
        """Return the scene's models; `settings` go to TriangleMesh."""
        meshes = {
            name: engine.TriangleMesh(*mesh, name=name, **settings)
            for name, mesh in self.scene.meshes.items()
        }
        return meshes | self.scene.surfaces


@dataclass(frozen=True)
class Part:
    """A part of the study.

    Attributes:
        name: on the command line, and of its files.
        title: on the page.
        measure: turns a job into rows of data.
        tell: turns all rows into Markdown, with `{name}` in the place of a figure.
        draw: by the name of a figure, turns all rows into it.
        scenes: names of scenes; if an entry has several, the first that is available is taken.
    """

    name: str
    title: str
    measure: Callable[[Job], Rows]
    tell: Callable[[Rows], str]
    draw: Mapping[str, Callable[[Rows], Figure]]
    scenes: tuple[str | tuple[str, ...], ...]


def only(rows: Rows, **wanted: str | float) -> Rows:
    """Return the rows with these values."""
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def values(rows: Rows, key: str) -> list:
    """Return the different values of a column, in the order in which they first occur."""
    return list(dict.fromkeys(row[key] for row in rows))

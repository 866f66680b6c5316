"""The file of people's decisions about conflicts: its place, its content, and how it is written.

It is JSON: ``version`` 1, the ``scene`` and a list of ``conflicts``. Each conflict has the names
``a`` and ``b``, its ``status`` and ``comment``, when it was ``decided``, and how the pair was then:
``state``, ``lower_m`` and ``upper_m``. ``camera_m`` is the camera of the person who decided: its
position, then the point at which it looked, six numbers in the scene's frame.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from proximity_monitor.display.choice import PairName
from proximity_monitor.display.order import CONTACT_KIND, KINDS
from proximity_monitor.display.state import SceneInfo, refuse_surrogates
from proximity_monitor.scene import bundled
from proximity_monitor.scene.paths import bundled_names

try:
    import fcntl
except ImportError:  # not a POSIX system
    fcntl = None

NEW, ACCEPTED, IGNORED = STATUSES = ("new", "accepted", "ignored")

VERSION = 1
SUFFIX = ".conflicts.json"

BYTES = 20_000_000
"""Largest file that is read."""

FAR_M = 1e9
"""Largest absolute value of a number in the file."""

MUCH = 2.0
"""An overlap is worse if it is certainly more than this many times as deep as before. The search's
tolerance, or noise in the poses, can make it a little deeper."""

_FORGOTTEN = "Decisions will be lost at the end: start the display with -p conflicts:=FILE"


class Decision(NamedTuple):
    """What somebody decided about a pair, and how the pair was then."""

    status: str = NEW
    comment: str = ""
    state: str = ""
    """One of `order.KINDS`; empty: not known."""
    lower: float | None = None
    """Metres, as `upper` is; None: not known."""
    upper: float | None = None
    decided: str = ""
    """The moment, ISO 8601, in UTC; empty: never."""
    camera: tuple[float, ...] | None = None
    """Six numbers in metres: the position of the person's camera, and the point it looked at.
    None: not known."""

    def outgrown(self, state: str, upper: float) -> bool:
        """Return whether a pair is worse now than when it was accepted or ignored.

        It is worse if it has a worse state, if it overlaps for certain and did not, or if its
        overlap is certainly more than `MUCH` times as deep.

        Args:
            state: the pair's state now, one of `order.KINDS`; empty: not known.
            upper: the pair's upper bound now, metres; NaN: not known.
        """
        if self.status == NEW or self.state not in KINDS or state not in KINDS or state == "stale":
            return False
        if state != self.state:
            return KINDS.index(state) < KINDS.index(self.state)
        if state != KINDS[CONTACT_KIND] or self.upper is None:
            return False
        if self.upper >= 0.0:
            return upper < 0.0
        return self.lower is not None and upper < MUCH * self.lower


Decisions = dict[frozenset[str], Decision]
"""Decisions by the names of both parts, in any order."""

Unsaved = Mapping[frozenset[str], tuple[PairName, Decision]]


def place(scene: SceneInfo, given: str) -> tuple[Path | None, str]:
    """Return the file for the decisions of a scene, or None and why there is no place for it.

    Args:
        scene: the scene; its file may be on another machine.
        given: the path that a person chose. If empty, the place is beside the scene's file. Bundled
            scenes belong to the package, so theirs is in the person's own data folder.
    """
    try:
        return _place(scene, given)
    except (OSError, RuntimeError) as error:  # an unreadable folder, or a loop of symbolic links
        return None, f"{given or scene.path}: {error}. {_FORGOTTEN}"


def _place(scene: SceneInfo, given: str) -> tuple[Path | None, str]:
    if given:
        return Path(given).expanduser().absolute(), ""
    path = Path(scene.path)
    if path.resolve() in map(bundled, bundled_names()):
        data = Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share")
        return data / "proximity_monitor" / f"{path.parent.name}{SUFFIX}", ""
    if not scene.path or not path.is_file():
        return None, f"The scene {scene.path or scene.name} is not on this machine. {_FORGOTTEN}"
    return path.with_suffix(SUFFIX), ""


def read(path: Path) -> dict[str, Any]:
    """Return the checked content of a file; if there is no file, the content of an empty one.

    Raises:
        OSError, ValueError: the file cannot be read, or is not a file of decisions.
    """
    try:
        with path.open("rb") as file:
            data = file.read(BYTES + 1)
    except FileNotFoundError:
        return {"version": VERSION, "conflicts": []}
    if len(data) > BYTES:
        raise ValueError(f"it has more than {BYTES} bytes")
    try:
        told = json.loads(data, object_pairs_hook=_object)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error
    refuse_surrogates(told)
    if not isinstance(told, dict) or told.get("version") != VERSION:
        raise ValueError(f"its version is not {VERSION}")
    if not isinstance(told.get("conflicts"), list):
        raise ValueError("it has no list of conflicts")
    for i, each in enumerate(told["conflicts"]):
        if not isinstance(each, dict) or not _sound(each):
            raise ValueError(f"conflict {i + 1} in it is not a pair with a status")
    return told


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object, unless writing it again would lose one of its values."""
    made = dict(pairs)
    if len(made) < len(pairs):
        raise ValueError(f"a key appears twice among {', '.join(key for key, _ in pairs)}")
    return made


def _sound(each: Mapping[str, Any]) -> bool:
    texts = (each.get(key, "") for key in ("comment", "state", "decided"))
    numbers, camera = (each.get(key) for key in ("lower_m", "upper_m")), each.get("camera_m")
    return (
        each.get("status") in STATUSES
        and all(isinstance(each.get(key), str) for key in "ab")
        and all(isinstance(text, str) for text in texts)
        and all(x is None or _is_number(x) for x in numbers)
        and (camera is None or (isinstance(camera, list) and is_camera(camera)))
    )


def is_camera(numbers: Sequence[Any]) -> bool:
    """Return whether numbers can be a `Decision.camera`: it does not look at its own position."""
    return len(numbers) == 6 and all(map(_is_number, numbers)) and numbers[:3] != numbers[3:]


def _is_number(x: Any) -> bool:
    return type(x) in (int, float) and abs(x) <= FAR_M


def decisions(told: Mapping[str, Any]) -> Decisions:
    """Return the decisions of a file's content."""
    return {
        frozenset((each["a"], each["b"])): Decision(
            each["status"],
            *(each.get(key, "") for key in ("comment", "state")),
            *(each.get(key) for key in ("lower_m", "upper_m")),
            each.get("decided", ""),
            tuple(each["camera_m"]) if each.get("camera_m") else None,
        )
        for each in told["conflicts"]
    }


def merged(told: Mapping[str, Any], unsaved: Unsaved, scene: str) -> dict[str, Any]:
    """Return a file's content with the unsaved decisions put in; its other content stays."""
    kept, before = [], {}
    for entry in told["conflicts"]:
        key = frozenset((entry["a"], entry["b"]))
        if key in unsaved:
            before[key] = entry
        else:
            kept.append(entry)
    for key, ((a, b), each) in unsaved.items():
        bounds = {"lower_m": each.lower, "upper_m": each.upper}
        words = {"status": each.status, "comment": each.comment, "state": each.state}
        seen = {"decided": each.decided, "camera_m": each.camera}
        entry = {"a": a, "b": b, **words, **bounds, **seen}
        others = {what: x for what, x in before.get(key, {}).items() if what not in entry}
        if others or each.status != NEW or each.comment:
            kept.append(entry | others)
    return {"scene": scene, **told, "conflicts": kept}


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """Lock the folder of a file, so that no other display writes between our read and write.

    Raises:
        OSError: another display holds the lock, or the folder cannot be made.
    """
    folder = path.resolve().parent
    folder.mkdir(parents=True, exist_ok=True)
    if fcntl is None:
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise BlockingIOError(error.errno, "another display is writing to it") from error
        yield
    finally:
        os.close(handle)


def write(path: Path, told: Mapping[str, Any]) -> None:
    """Replace a file in one step: a reader, also after a crash, finds the old or the new content.

    The file keeps its permissions.

    Raises:
        OSError: it cannot be written; then it is unchanged.
    """
    path = path.resolve()  # a symbolic link stays a link
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with beside.open("w", encoding="utf-8") as file:
            json.dump(told, file, indent=1, ensure_ascii=False)
            file.write("\n")
            file.flush()
            os.fsync(file.fileno())
        if path.exists():
            shutil.copymode(path, beside)
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)

"""Tables 2 to 4 of the 1999 paper: kinds of bounding volume, applications and questions."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from proximity_monitor import engine

from .certificate import check
from .paper import QUESTIONS, VOLUMES
from .part import Job, Rows
from .timing import Asker, Query, blocks, summary, take_turns

_REL_ERR = {"exact": 0.0, "10 %": 0.1}

_BLOCKS = {
    "engine/piston-block": (4, 1, 4),
    "falling-tori": (9, 1, 64),
    "tori": (9, 1, 64),
    "cave/random": (6, 1, 64),
    "chain": (6, 1, 8),
}
"""How many blocks of steps, how many in a quick run, and how many steps each block has."""
_FEW = 16
"""Steps of a block in a quick run, at most."""


def measure(job: Job) -> Rows:
    """Return one row for each question and kind of volume.

    Raises:
        BrokenCertificateError: two kinds of volume whose answers contradict each other.
    """
    models = {volume: job.models(volume=volume) for volume in VOLUMES}
    full, quick, length = _BLOCKS[job.name]
    if job.quick:
        full, length = quick, min(length, _FEW)
    turns = blocks(len(job.scene.tracks[0].poses_a), length, full)
    cases = [(question, volume) for question in QUESTIONS for volume in VOLUMES]
    askers = {case: _asker(job, models[case[1]], case[0]) for case in cases}
    found = take_turns(askers, turns, job.advance)
    rows = []
    for question, volume in cases:
        timed = found[question, volume]
        if question in _REL_ERR:
            where = f"{job.name}, {question}, {volume}"
            check(where, timed, found["exact", "rss"], _REL_ERR[question])
        row = {"scene": job.name, "question": question, "volume": volume}
        rows.append(row | summary(timed))
    return rows


def _asker(job: Job, models: dict[str, engine.TriangleMesh], question: str) -> Asker:
    """Return an asker about every pair at every step; each pair remembers its last answer."""
    tracks = job.scene.tracks
    pairs = [(track, engine.Pair(models[track.a], models[track.b])) for track in tracks]

    def ask(steps: Sequence[int]) -> list[Query]:
        return [
            partial(_method(pair, question), track.poses_a[i], track.poses_b[i])
            for track, pair in pairs
            for i in steps
        ]

    return ask


def _method(pair: engine.Pair, question: str) -> Any:
    if question in _REL_ERR:
        return partial(pair.distance, rel_err=_REL_ERR[question])
    return pair.collide

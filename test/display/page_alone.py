"""A page without a real browser, and the messages that a monitor would send it."""

from __future__ import annotations

import asyncio
import re
import time
from types import SimpleNamespace

import numpy as np

from proximity_monitor.display import page as pages
from proximity_monitor.display import pages as all_pages
from proximity_monitor.display.holds import Holds
from proximity_monitor.display.inbox import Inbox
from proximity_monitor.display.received import Part
from proximity_monitor.display.state import Body, Frame, Pairs, SceneInfo, Thresholds, Unit

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
HERE = np.array([0.0, 0, 0, 1, 0, 0, 0])
THERE = np.array([3.0, 0, 0, 1, 0, 0, 0])
NAMES = ("<i>a", "b")
SCENE = SceneInfo(
    name="cell",
    description="",
    frame="world",
    unit=Unit("mm", 0.001),
    bodies=tuple(Body(name, True, f"/{i}", False, "1") for i, name in enumerate(NAMES)),
    deforming=frozenset(),
    pairs=1,
    thresholds=Thresholds(0.1, 0.02, 0.0),
    own_thresholds={},
    own_parameters=True,
    settings={"rate_hz": 30.0, "budget_ms": 10.0, "rel_err": 0.0, "abs_err": 0.0},
)
PARTS = [Part(HERE, np.ones(4), CORNERS) for _ in NAMES]


def frame(stamp_s, clearance=0.3, level=0, poses=(HERE, THERE)):
    bound = np.array([clearance])
    told = Pairs(
        (NAMES,), bound, bound, np.zeros((1, 2, 3)), np.zeros(1, np.int8),
        np.array([level], np.int8), np.zeros(1), np.zeros(1), ("",),
    )  # fmt: skip
    return Frame(stamp_s, np.array(poses), told)


def page_of(server, client, monkeypatch, conflicts):
    """Return the page of one browser, with a scene, and all that it shares with other pages."""
    monkeypatch.setattr(all_pages, "STEP_S", np.inf)
    monkeypatch.setattr(pages, "TABLE_S", 0.0)
    monkeypatch.setattr(pages, "LONGEST_S", 0.0)
    inbox, holds, logged, asked = Inbox(), Holds(), [], []
    node = SimpleNamespace(
        set_parameters_of_monitor=lambda values: None,
        set_parameters_of_player=asked.append,
        reset_minima_of_monitor=lambda: None,
        get_logger=lambda: SimpleNamespace(error=logged.append),
        conflicts=str(conflicts),
    )
    made = all_pages.Pages(server, inbox, holds, node)

    def tell(**news):
        if "scene" in news and news["scene"].key != getattr(inbox.news.scene, "key", None):
            holds.begin(news["scene"].key)  # as the node does
        inbox.tell(**news, frame_at_s=time.monotonic(), health_at_s=time.monotonic(), present=True)
        made.step()

    tell(scene=SCENE, parts=PARTS, frame=frame(0.0))
    assert not logged
    own = made._pages[client.client_id]
    return SimpleNamespace(
        tell=tell, all=own, pages=made, move=own._move, choice=own._choice, holds=holds,
        hand=own.hand, session=made._shared.session, events=made._shared.events, logged=logged,
        asked=asked,
    )  # fmt: skip


def words(html):
    """Return the text that is shown while the data is fresh."""
    content = re.sub("<span class=pm-then>[^<]*</span>", "", html.content)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", content)).strip()


def drag(page, phase, x):
    at = SimpleNamespace(position=(x, 0.0, 0.0), wxyz=(1.0, 0.0, 0.0, 0.0))
    asyncio.run(page.move._on_drag(SimpleNamespace(phase=phase, target=at)))

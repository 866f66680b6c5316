"""The pages of all browsers, and the loop that keeps them up to date."""

from __future__ import annotations

import asyncio
import time
import traceback
from collections.abc import Callable, Mapping
from typing import Any

import viser

from proximity_monitor.display.conflicts import DecisionStore
from proximity_monitor.display.connection import connection
from proximity_monitor.display.events import Events
from proximity_monitor.display.holds import Holds
from proximity_monitor.display.inbox import Inbox
from proximity_monitor.display.node import ProximityDisplay
from proximity_monitor.display.page import Page
from proximity_monitor.display.session import Session
from proximity_monitor.display.shared import Shared
from proximity_monitor.display.state import SceneInfo
from proximity_monitor.display.tried import Tried

STEP_S = 0.03
"""After this many seconds of a step, the other browsers wait for the next: all get a share."""


class Pages:
    """A page for each connected browser; an error on one page does not affect the others."""

    def __init__(
        self, server: viser.ViserServer, inbox: Inbox, holds: Holds, node: ProximityDisplay
    ) -> None:
        """Begin without browsers.

        Args:
            server: brings the browsers.
            inbox: has the monitor's messages.
            holds: the bodies that are held here.
            node: sends requests to the monitor and the player, and logs.
        """
        asks = (
            node.set_parameters_of_monitor,
            node.set_parameters_of_player,
            node.reset_minima_of_monitor,
        )
        decisions = DecisionStore(node.conflicts)
        self._shared = Shared(server, holds, Session(), Events(), decisions, Tried(), *asks)
        self._inbox = inbox
        self._log = node.get_logger().error
        self._logged: str | None = None
        self._scene: SceneInfo | None = None
        self._problem = ""  # the last logged problem of the file of conflicts
        self._pages: dict[int, Page] = {}
        self._overheard = ""  # an error of a callback since the last step
        server.get_event_loop().set_exception_handler(self._on_error)

    def step(self) -> None:
        """Bring all pages up to date. Errors are logged and shown, and the next step tries again.

        If what the pages share fails, all pages show the error and are not updated, so they grow
        old. If one page fails, only that page shows it.
        """
        overheard, self._overheard = self._overheard, ""
        fault = self._guarded(self._follow)
        news, now_s = self._inbox.news, time.monotonic()
        told = connection(news, now_s)
        beside = self._guarded(self._meet) or overheard
        for client in list(self._pages):
            page = self._pages[client] = self._pages.pop(client)  # now the last in the order

            def show(page: Page = page) -> None:
                page.step(news, told, now_s)

            asked = self._guarded(page.take_up)
            page.admit(fault or self._guarded(show) or asked or beside, now_s)
            if time.monotonic() > now_s + STEP_S:
                break

    def _follow(self) -> None:
        """Keep what all pages share up to date."""
        news, shared = self._inbox.read(), self._shared
        if not news.complete:
            return
        if self._scene is None or self._scene.key != news.scene.key:
            shared.session.clear()
            shared.events.clear()
        self._scene = news.scene
        shared.holds.follow(news.scene.held)
        for frame in (*news.passed, news.frame):  # every tick counts; only the last is shown
            if frame is shared.session.newest or len(frame.poses) != len(news.scene.moving):
                continue
            if shared.session.ends_with(frame):
                shared.events.clear()
            shared.session.add(frame, keep=shared.events.note(frame, news.scene))
        shared.tried.note(news.scene, news.frame, news.health)
        shared.decisions.follow(news.scene, time.monotonic())
        if shared.decisions.problem not in ("", self._problem):
            self._log(shared.decisions.problem)
        self._problem = shared.decisions.problem

    def _meet(self) -> None:
        """Give each new browser a page, and release what a browser that is gone has held."""
        clients = self._shared.server.get_clients()
        for gone in self._pages.keys() - clients.keys():
            self._pages.pop(gone).hand.leave()
        for new in sorted(clients.keys() - self._pages.keys()):
            self._pages[new] = Page(clients[new], self._shared)

    def _guarded(self, step: Callable[[], None]) -> str:
        """Run a step. If it fails, log the error and return it as one line; empty: no error."""
        try:
            step()
        except Exception as error:
            return self._tell(error)
        return ""

    def _on_error(self, _: asyncio.AbstractEventLoop, context: Mapping[str, Any]) -> None:
        """Take an error that no callback caught while it handled a browser's message."""
        error = context.get("exception")
        if isinstance(error, Exception):
            self._overheard = self._tell(error)

    def _tell(self, error: Exception) -> str:
        """Log an error, and return it as one line."""
        line = f"{type(error).__name__}: {error}"
        told = f"a page failed, {line}\n{''.join(traceback.format_exception(error)).rstrip()}"
        told = told.replace("\n", "\n  ")  # indented: the demo sees where the record ends
        if told != self._logged:  # otherwise the same error is logged 25 times a second
            self._logged = told
            self._log(told)
        return line

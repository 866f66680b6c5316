"""The session as one HTML file that plays from a disk: the scene in 3D and a report beside it."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from proximity_monitor.display import serving
from proximity_monitor.display.choice import Choice
from proximity_monitor.display.labels import Labels
from proximity_monitor.display.lines import Lines
from proximity_monitor.display.parts import Parts
from proximity_monitor.display.received import Part
from proximity_monitor.display.session import Session
from proximity_monitor.display.signs import between, clearance, length, sign
from proximity_monitor.display.state import OVERLAPPING, Frame, SceneInfo
from proximity_monitor.display.style import STYLE
from proximity_monitor.display.unlisted import reason, sign_of
from proximity_monitor.display.view import View
from proximity_monitor.scene.naming import counted

CONTROLS = "56px"
"""Height of the controls below the report: play, pause and seek."""

FRAMES = 400
"""Maximum number of moments of the session in the file, besides the last one."""

PAUSE_S = 10.0
"""Maximum seconds of a pause in the replay, however long no tick came."""


def replay_html(
    scene: SceneInfo, parts: Sequence[Part], session: Session, choice: Choice, camera: np.ndarray
) -> str:
    """Return the replay as an HTML document.

    It ends with the session's last tick. Pauses longer than `PAUSE_S` are cut to that.

    Args:
        scene: the scene of the session.
        parts: the meshes of its bodies.
        session: the session, with at least one frame.
        choice: the highlighted and the ignored pairs, and how many pairs are drawn.
        camera: (2, 3) the position and the target of the camera, in the page's units.
    """
    kept = session.frames
    frames = kept[:: -(-len(kept) // FRAMES)]
    played = f"{len(frames)} of {len(kept)} kept ticks"
    if frames[-1] is not session.newest:
        frames.append(session.newest)
    # Use a server to which nobody connects, so that no open page shows the replay's moments.
    server = serving.serve("127.0.0.1", 0, "")
    try:
        views = Parts(server, scene, parts)
        lines = Lines(server, views.scale, views.size)
        labels = Labels(server.scene, "/distances", every_s=0.0)
        server.initial_camera.position, server.initial_camera.look_at = camera
        recorder = server.get_scene_serializer()
        for frame, after in zip(frames, [*frames[1:], frames[-1]], strict=True):
            views.show(frame, {}, choice, choice.pair or ())
            lines.show(frame.pairs, scene, choice)
            labels.show([*lines.labels, *views.labels()], View.looking(*camera), lines.tips)
            recorder.insert_sleep(min(after.stamp_s - frame.stamp_s, PAUSE_S))
        document = recorder.as_html()
    finally:
        serving.stop(server)
    if max(np.diff([frame.stamp_s for frame in frames]), default=0.0) > PAUSE_S:
        played += f", pauses cut to {PAUSE_S:.0f} s"
    beside = report(scene, session, frames[-1], played)
    return document.replace("</body>", f"{beside}</body>", 1)


def report(scene: SceneInfo, session: Session, last: Frame, played: str) -> str:
    """Return a table of all pairs that were listed, with their smallest and last clearances.

    Args:
        scene: the scene of the session.
        session: the session, with at least one frame.
        last: its last tick.
        played: says how much of the session the replay plays.
    """
    unit, pairs = scene.unit, last.pairs
    rows = []
    for a, b in dict.fromkeys((*pairs.names, *session.pairs)):
        found, thresholds = session.worst((a, b)), scene.thresholds_of((a, b))
        i = pairs.places.get((a, b))
        if i is None:
            shown, end = sign_of((a, b), pairs, scene), reason((a, b), pairs, scene)
        else:
            shown, end = sign(pairs, i, scene), clearance(pairs, i, unit)
        least, smallest = float("inf"), "n/a"
        if found is not None:
            least, overlapping = found[1].upper, found[1].status == OVERLAPPING
            smallest = between(session.lowest((a, b)), least, overlapping, unit)
        when = f"{found[1].stamp_s - session.span_s[0]:.1f} s" if found is not None else ""
        rows.append(
            (
                least,
                f"<tr><td>{escape(a)} - {escape(b)}</td>"
                f"<td class=pm-num>{smallest}</td><td class=pm-num>{when}</td>"
                f"<td class=pm-num>{end}</td>"
                f'<td class=pm-sign style="color:{shown.colour}">{shown.glyph} {shown.word}</td>'
                f"<td class=pm-num>{length(thresholds.warn, unit)}</td>"
                f"<td class=pm-num>{length(thresholds.stop, unit)}</td></tr>",
            )
        )
    rows.sort(key=lambda row: row[0])
    start, end = session.span_s
    many = counted(len(rows), "pair that was", "pairs that were")
    if session.thinned_s is not None:
        played += f", thinned to one in {session.thinned_s:.1f} s"
    return (
        f'{STYLE}<details open id="pm-report" class=pm style="position:fixed;left:0;'
        f"bottom:{CONTROLS};max-height:40vh;overflow:auto;background:#fffe;color:#222;"
        "padding:8px 12px;"
        'border:1px solid #8886;border-radius:6px;z-index:10">'
        f"<summary><b>{escape(scene.name)}</b>: {many} listed,"
        f" {end - start:.1f} s (plays {played}), nearest first</summary>"
        "<table class=pm-table><tr><th>pair</th>"
        "<th class=pm-num>smallest</th><th class=pm-num>at</th><th class=pm-num>at the end</th>"
        "<th>state at the end</th><th class=pm-num>warn</th><th class=pm-num>stop</th></tr>"
        f"{''.join(row for _, row in rows)}</table></details>"
    )

"""Attaching a body to another and detaching it while the node runs."""

import json

import pytest
from deadlines import START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from diagnostic_msgs.msg import DiagnosticStatus

ON_DIE = (0.8, 0.1, 1.15)  # 50 mm above the die, which is 200 mm high, at (0.8, 0.1, 0.9)


@pytest.fixture
def detached(peer):
    yield peer
    assert peer.set_parameters(attachments__ball="", attachments__die="")[0]


def inputs(peer):
    health = peer.health()
    return health["inputs"] if health else {}


def attach(peer):
    """Attach the ball to the die; return by how much (m) the ball is higher above the table."""
    pairs = peer.settle(ball=ON_DIE)
    assert pairs["ball - die"]["state"] == "warn"
    assert peer.set_parameters(attachments__ball="die") == (True, "")
    return float(pairs["table - ball"]["lower_m"]) - float(pairs["table - die"]["lower_m"])


def test_an_attached_body_goes_where_the_other_goes_and_their_pair_is_not_watched(detached):
    peer = detached
    lead = attach(peer)
    alert, *_ = peer.wait(
        lambda: [a for a in peer.alerts("ball - die") if "attached" in a.message], "its alert"
    )
    assert alert.level == DiagnosticStatus.OK
    peer.hold(ball=(0.0, 0.0, 5.0), die=(0.5, 0.0, 0.4))

    def carried():
        pairs = peer.pairs()
        if set(pairs) != {"table - ball", "table - die"}:
            return None
        die, ball = (float(pairs[f"table - {each}"]["lower_m"]) for each in ("die", "ball"))
        return die == pytest.approx(0.3, abs=1e-9) and ball == pytest.approx(die + lead, abs=1e-9)

    peer.wait(carried, "the ball to be carried")
    peer.wait(lambda: inputs(peer).get("attached bodies") == "ball on die", "the diagnostics")
    peer.wait(lambda: int(inputs(peer)["rejected: body is attached"]) > 0, "the ball's own poses")

    assert peer.set_parameters(attachments__ball="") == (True, "")
    pairs = peer.settle(die=(0.5, 0.0, 0.4))
    assert set(pairs) == {"table - ball", "table - die", "ball - die"}
    assert inputs(peer) is not None


def test_a_child_is_stale_with_its_parent_and_stays_where_it_was_put_down(detached, impatient):
    peer = impatient
    attach(peer)
    peer.hold(ball=(0.0, 0.0, 5.0))
    stale = peer.wait(
        lambda: (p := peer.pairs()) and p["table - ball"]["state"] == "stale" and p,
        "the ball to be stale, whatever is published of it",
    )
    assert "no recent pose of ball" in stale["table - ball"]["text"]
    peer.hold(die=(0.5, 0.0, 0.4))
    carried = peer.wait(
        lambda: (p := peer.pairs()) and p["table - ball"]["state"] == "clear" and p,
        "the die to speak again",
    )
    assert peer.set_parameters(attachments__ball="") == (True, "")
    left = peer.wait(
        lambda: (p := peer.pairs()) and "ball - die" in p and p["table - ball"], "the pair again"
    )
    assert left["upper_m"] == carried["table - ball"]["upper_m"]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"attachments__ball": "ball"}, "ball -> ball form a cycle"),
        ({"attachments__ball": "die", "attachments__die": "ball"}, "form a cycle"),
        ({"attachments__ball": "lid"}, "no body is named 'lid'"),
        ({"attachments__table": "ball"}, "undeclared"),
    ],
)
def test_what_cannot_be_attached_is_refused_with_the_reason(peer, change, reason):
    done, why = peer.set_parameters(**change)
    assert not done
    assert reason in why
    assert len(peer.settle()) == 3


@pytest.mark.long
def test_a_node_can_start_with_bodies_attached(launch, scene_file, new_peer):
    process = launch(
        "node",
        "-r",
        "__ns:=/assembled",
        scene=scene_file,
        **{"attachments.ball": "table", "attachments.die": "ball"},
    )
    peer = new_peer(process, "assembled")
    waiting = peer.wait(
        lambda: inputs(peer).get("waiting to be attached"), "the start", START_DEADLINE_S
    )
    assert waiting == "ball on table, die on ball"

    def told():
        scene = json.loads(peer.received["scene"][-1].data)
        return scene["attachments"], scene["held"], scene["unwatched"]

    parents = {"ball": "table", "die": "ball"}
    peer.wait(lambda: "scene" in peer.received, "the scene")
    assert told() == (parents, {}, [])
    peer.hold(ball=(0.0, 0.0, 0.5), die=(0.8, 0.1, 0.9))
    peer.wait(lambda: inputs(peer).get("attached bodies") == waiting, "both to be attached")
    peer.hold()
    pairs = peer.wait(lambda: (p := peer.pairs()) and len(p) == 1 and p, "the one pair left")
    assert pairs["table - die"]["state"] == "clear"
    unwatched = [["table", "ball"], ["ball", "die"]]
    peer.wait(lambda: told() == (parents, parents, unwatched), "the scene to tell of both")


def test_a_circle_given_at_start_ends_the_node_with_the_reason(launch, scene_file):
    both = {"attachments.ball": "die", "attachments.die": "ball"}
    process = launch("node", scene=scene_file, **both)
    assert process.ended() == 1
    assert "ball -> die -> ball form a cycle" in process.text
    assert "Traceback" not in process.text

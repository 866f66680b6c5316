"""Bodies whose vertices or control points arrive while the node runs."""

import threading

import numpy as np
import pytest
from deadlines import START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

from rclpy.duration import Duration
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2, PointField

SCENE = """
version: 1
frame: cell
unit: mm
rate_hz: 50
budget_ms: 15
bodies:
  - {name: wall, primitive: {box: {size: [10, 500, 500]}}, pose: {position: [-105, 0, 0]}}
  - {name: ball, primitive: {sphere: {radius: 100}}, moving: true, deforming: true}
  - name: pillar
    primitive: {sphere: {radius: 100}}
    pose: {position: [0, 900, 0]}
    deforming: true
  - {name: deck, model: deck.json, pose: {position: [0, 0, -300]}}
  - {name: sail, model: sail.json, pose: {position: [0, 0, -100]}, deforming: true}
  - {name: vase, model: vase.json, pose: {position: [0, 0, -700]}, deforming: true}
pairs:
  groups: {meshes: [wall, ball, pillar]}
  watch:
    - between: [meshes, meshes]
    - between: [deck, sail]
    - between: [deck, vase]
"""
PAIRS = {"ball": "wall - ball", "sail": "deck - sail", "vase": "deck - vase"}
CALLED = {"ball": "vertices", "sail": "control points", "vase": "control points"}
VASE = np.array(
    [[0, 0], [60, 0], [100, 0], [100, 60], [50, 100], [50, 140], [90, 180], [40, 190], [0, 200.0]]
)
"""Control points of the vase's profile, rho and z in mm; its tip is 0.2 m below the deck."""


def lifted(net, height):
    """Return a sail's control points with its middle higher by `height` metres.

    Only the inner one of nine control points moves; its weight in the middle is a quarter.
    """
    made = net.reshape(3, 3, 3).copy()
    made[1, 1, 2] += 4.0 * height
    return made.reshape(-1, 3)


def turned(profile):
    """Return profile points (n, 2), rho and z in mm, as points (n, 3) in metres at theta = 0."""
    return 1e-3 * np.column_stack((profile[:, 0], np.zeros(len(profile)), profile[:, 1]))


class Soft:
    """A peer that publishes the ball's poses, and the control points of each body in `shapes`."""

    def __init__(self, peer, rest):
        self.peer = peer
        self.rest = rest
        self.shapes = dict(rest)
        self.publishers = {
            name: peer.node.create_publisher(PointCloud2, self.topic(name), 1)
            for name in self.shapes
        }
        peer.hold(ball=(0.2, 0.0, 0.0))
        peer.node.create_timer(0.05, self._publish)

    def _publish(self):
        for name, shape in self.shapes.items():
            self.send(name, self.cloud(shape))

    def topic(self, name):
        return f"bodies/{name}/{CALLED.get(name, 'vertices').split()[0]}"

    def send(self, name, message):
        self.publishers[name].publish(message)

    def cloud(self, vertices, late_s=0.0, frame=""):
        fields = [
            PointField(name=name, offset=8 * i, datatype=PointField.FLOAT64, count=1)
            for i, name in enumerate("xyz")
        ]
        message = PointCloud2(
            height=1,
            width=len(vertices),
            fields=fields,
            point_step=24,
            row_step=24 * len(vertices),
            data=np.ascontiguousarray(vertices, "<f8").tobytes(),
        )
        message.header.frame_id = frame
        stamp = self.peer.node.get_clock().now() - Duration(nanoseconds=int(late_s * 1e9))
        message.header.stamp = stamp.to_msg()
        return message

    def pair(self, name="wall - ball"):
        return self.peer.pairs().get(name, {"state": "none", "text": ""})

    def wait_for_gap(self, expected, name="ball"):
        error = 2e-3 if name == "ball" else 1e-9  # a mesh approximates the ball

        def told():
            pair = self.pair(PAIRS[name])
            near = pair["state"] == "clear" and pair["age_s"] == "0.0000"
            return near and float(pair["upper_m"]) == pytest.approx(expected, abs=error)

        self.peer.wait(told, f"a gap of {expected} m", 180.0)

    def rejected(self, reason):
        return int(self.peer.health().get("inputs", {}).get(f"rejected: {reason}", 0))


@pytest.fixture(scope="module")
def soft(launch_for_all, peer_for_all, tmp_path_factory):
    from proximity_monitor import engine
    from proximity_monitor.scene import load_scene
    from proximity_monitor.scene.opening import load_models

    path = tmp_path_factory.mktemp("soft") / "soft.yaml"
    path.write_text(SCENE)
    for name, count in (("deck", 2), ("sail", 3)):
        x, y = np.meshgrid(*2 * [np.linspace(-400.0, 400.0, count)], indexing="ij")
        flat = np.stack((x, y, np.zeros_like(x)), axis=-1)
        engine.save_geomdl(engine.Patch(flat), path.with_name(f"{name}.json"))
    made = engine.SolidOfRevolution([engine.Curve(VASE, [0, *range(9), 8])])
    engine.save_geomdl(made, path.with_name("vase.json"))
    process = launch_for_all("node", "-r", "__ns:=/soft", scene=path, pose_timeout_s=1.0)
    peer = peer_for_all(process, "soft")
    models = load_models(load_scene(path))
    yield Soft(peer, {name: models[name].control_points for name in ("ball", "pillar", *CALLED)})
    process.stop()


@pytest.mark.long
def test_a_body_without_vertices_is_stale_until_they_come_and_follows_them(soft):
    shapes, soft.shapes = soft.shapes, {}
    soft.peer.wait(
        lambda: soft.pair()["state"] == "stale", "the ball to be stale", START_DEADLINE_S
    )
    soft.peer.wait(lambda: "no vertices yet of ball" in soft.pair()["text"], "the reason")
    soft.shapes = shapes
    soft.wait_for_gap(0.2)
    soft.shapes = shapes | {"ball": 0.5 * soft.rest["ball"]}
    soft.wait_for_gap(0.25)
    soft.shapes = shapes
    soft.wait_for_gap(0.2)


@pytest.mark.long
def test_a_surface_without_control_points_is_stale_until_they_come_and_follows_them(soft):
    shapes, soft.shapes = soft.shapes, {}
    stale = "no control points yet of sail", "no recent control points of sail"
    soft.peer.wait(
        lambda: any(why in soft.pair("deck - sail")["text"] for why in stale), "the reason"
    )
    assert soft.pair("deck - sail")["state"] == "stale"
    for height in (0.0, -0.15, 0.1, -0.199):  # the corners stay
        soft.shapes = shapes | {"sail": lifted(soft.rest["sail"], height)}
        soft.wait_for_gap(0.2 + min(height, 0.0), "sail")
    told = soft.pair("deck - sail")
    assert float(told["lower_m"]) == pytest.approx(0.001, abs=1e-9)
    soft.shapes = shapes
    soft.wait_for_gap(0.2, "sail")


@pytest.mark.long
def test_a_solid_of_revolution_follows_its_profile_and_refuses_what_is_none(soft):
    for height in (0.0, 0.15, -0.1, 0.199):  # the foot stays
        grown = soft.rest["vase"] * [1.0, 1.0, 1.0 + height / 0.2]
        soft.shapes = soft.rest | {"vase": grown}
        soft.wait_for_gap(0.2 - height, "vase")
    soft.shapes = dict(soft.rest)
    soft.wait_for_gap(0.2, "vase")
    beyond, crossing = VASE.copy(), VASE.copy()
    beyond[4, 0] = -20.0
    crossing[[3, 5]] = crossing[[5, 3]]
    aside = soft.rest["vase"] + [0.0, 0.01, 0.0]
    for bad in (turned(beyond), turned(crossing), aside):
        before = soft.rejected("no sound shape")
        soft.shapes = soft.rest | {"vase": bad}
        soft.peer.wait(lambda n=before: soft.rejected("no sound shape") > n, "a count")
    soft.peer.wait(
        lambda: "no recent control points of vase" in soft.pair("deck - vase")["text"],
        "bad profiles to keep nothing fresh",
    )
    soft.shapes = dict(soft.rest)
    soft.wait_for_gap(0.2, "vase")


@pytest.mark.parametrize("silent", ["ball", "pillar"])
def test_vertices_that_fall_silent_make_their_body_stale(soft, silent):
    """The ball is stale although its poses go on. The pillar is fixed and has no poses."""
    soft.wait_for_gap(0.2)
    soft.shapes = {name: rest for name, rest in soft.rest.items() if name != silent}
    pair = "ball - pillar"
    why = f"no recent vertices of {silent}"
    soft.peer.wait(lambda: why in soft.pair(pair)["text"], "the pair to become stale")
    assert soft.pair(pair)["state"] == "stale"
    state = "stale" if silent == "ball" else "clear"
    soft.peer.wait(lambda: soft.pair()["state"] == state, f"the wall and the ball to be {state}")
    inputs = soft.peer.wait(
        lambda: (i := soft.peer.health().get("inputs")) and i["silent bodies"] == silent and i,
        "diagnostics of the silent body",
    )
    assert why in inputs["text"]
    soft.peer.wait(lambda: soft.peer.next("clearance").data == 0.0, "no clearance")
    soft.shapes = dict(soft.rest)
    soft.wait_for_gap(0.2)


@pytest.mark.long
@pytest.mark.parametrize("body", PAIRS)
def test_bad_points_are_counted_by_reason_and_keep_nothing_fresh(soft, body):
    rest = soft.rest[body]
    holed = rest.copy()
    holed[7, 1] = np.nan
    cloud = soft.cloud
    bad = {
        "wrong length": lambda: cloud(rest[:-1]),
        "not finite": lambda: cloud(holed),
        "position out of range": lambda: cloud(rest * 1e12),
        "other frame": lambda: cloud(rest, frame="nowhere"),
        "stale stamp": lambda: cloud(rest, late_s=3600.0),
        "stamp in the future": lambda: cloud(rest, late_s=-3600.0),
        "stamp out of order": lambda: cloud(rest, late_s=0.5),
    }
    before = {reason: soft.rejected(reason) for reason in bad}
    soft.wait_for_gap(0.2, body)

    def counted():
        for reason, make in bad.items():
            if soft.rejected(reason) == before[reason]:
                # Send a good cloud first, newer than the one that is out of order. The pauses let
                # each cloud be read before the next one replaces it.
                for message in (cloud(rest), make()):
                    soft.send(body, message)
                    threading.Event().wait(0.05)
                soft.peer.executor.spin_once(timeout_sec=0.02)
        return all(soft.rejected(reason) > before[reason] for reason in bad)

    soft.peer.wait(counted, "a count of each reason", 120.0)
    soft.wait_for_gap(0.2, body)

    soft.shapes = soft.rest | {body: holed}
    why = f"no recent {CALLED[body]} of {body}"
    soft.peer.wait(lambda: why in soft.pair(PAIRS[body])["text"], "the NaN to keep nothing fresh")
    assert soft.pair(PAIRS[body])["state"] == "stale"
    soft.shapes = dict(soft.rest)
    unread = soft.rejected("unreadable layout")

    def unreadable():
        message = soft.cloud(rest, frame=body)  # new stamp: a good cloud may have arrived since
        message.fields = []
        soft.send(body, message)
        return soft.rejected("unreadable layout") > unread

    soft.peer.wait(unreadable, "an unreadable cloud")
    soft.wait_for_gap(0.2, body)

    best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    other = soft.peer.node.create_publisher(PointCloud2, soft.topic(body), best_effort)
    key = f"incompatible QoS: {soft.topic(body)}"
    soft.peer.wait(
        lambda: soft.peer.health()["outputs"].get(key) == "1", "the publisher that does not fit"
    )
    soft.peer.node.destroy_publisher(other)

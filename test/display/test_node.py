"""The display's node beside a player and a monitor that these tests simulate."""

import json
import subprocess
import sys
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from deadlines import DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

import rclpy
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.exceptions import ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import Trigger

from proximity_monitor.display import node as module
from proximity_monitor.display import run
from proximity_monitor.display.holds import Hand, Holds
from proximity_monitor.display.inbox import Inbox
from proximity_monitor.display.node import ProximityDisplay

NAMESPACE = "/shown"
"""Namespace of the display and its player. The monitors of other tests are outside it: their scenes
would replace the scene below and release all held bodies."""
BALL, DIE = f"{NAMESPACE}/bodies/ball/pose", f"{NAMESPACE}/bodies/die/pose"
RETRY_S = 2.0
HERE = np.array([0.0, 0, 0, 1, 0, 0, 0])
BODIES = [
    {"name": name, "moving": True, "topic": topic, "point": False, "mesh": "1"}
    for name, topic in (("ball", BALL), ("die", DIE))
]
SCENE = {
    "name": "cell",
    "path": "/scenes/cell.yaml",
    "description": "",
    "frame": "world",
    "unit": {"symbol": "mm", "to_metre": 0.001},
    "bodies": BODIES,
    "checksum": 1,
    "words": [],
    "deforming": [],
    "pairs": 1,
    "thresholds": {"warn": 0.1, "stop": 0.02, "hysteresis": 0.0},
    "own_thresholds": [],
    "attachments": {},
    "held": {},
    "unwatched": [],
    "own_parameters": True,
    "settings": {"rate_hz": 30.0},
}


@pytest.fixture
def display(rclpy_context):
    """The node with a scene, and an executor that other nodes may join."""
    inbox, holds = Inbox(), Holds()
    node = ProximityDisplay(inbox, holds, namespace=NAMESPACE)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    node._on_scene(String(data=json.dumps(SCENE)))

    def until(condition, what):
        deadline = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < deadline, f"waited for {what}"
            executor.spin_once(timeout_sec=0.05)

    yield SimpleNamespace(
        node=node, inbox=inbox, holds=Hand(holds, "one"), executor=executor, until=until
    )
    executor.shutdown()
    node.destroy_node()


@pytest.fixture
def player(display):
    """Starts and ends players with a publisher of the ball's pose and the parameter `released`."""
    made = []

    def start(refuses=False):
        node = rclpy.create_node("proximity_player", namespace=NAMESPACE)
        node.create_publisher(PoseStamped, BALL, 1)
        node.declare_parameter("released", Parameter.Type.STRING_ARRAY)
        node.refuses = refuses
        node.add_on_set_parameters_callback(
            lambda _: SetParametersResult(successful=not node.refuses, reason="not now")
        )
        made.append(node)
        display.executor.add_node(node)
        return node

    def end(node):
        made.remove(node)
        display.executor.remove_node(node)
        node.destroy_node()

    yield SimpleNamespace(start=start, end=end)
    for node in list(made):
        end(node)


def released(player):
    value = player.get_parameter_or("released").value
    return None if value is None else list(value)


def test_a_player_that_comes_is_told_what_is_held_and_one_that_comes_later_too(display, player):
    first = player.start()
    # This gives the player back the bodies that an earlier display held.
    display.until(lambda: released(first) == [], "the player to hear that nothing is held")
    display.holds.take("ball", HERE)
    display.until(lambda: released(first) == ["ball"], "the player to leave the ball alone")
    player.end(first)
    display.until(lambda: not display.node._to_player.service_is_ready(), "the player to go")
    display.until(lambda: display.node._released is None, "the display to notice")
    second = player.start()
    display.until(lambda: released(second) == ["ball"], "the next player to leave the ball alone")
    display.holds.release()
    display.until(lambda: released(second) == [], "the ball to be let go")


def test_a_player_is_a_rival_until_it_has_agreed(display, player):
    node = player.start(refuses=True)
    display.holds.take("ball", HERE)
    display.until(lambda: display.inbox.news.rivals == ("proximity_player",), "the rival")
    assert not display.node.player_knows
    node.refuses = False
    display.until(lambda: display.inbox.news.rivals == (), "the player to agree")
    assert released(node) == ["ball"]
    assert display.node.player_knows
    # Any other publisher of that topic stays a rival, even a player of another namespace.
    other = rclpy.create_node("proximity_player", namespace="/left")
    try:
        other.create_publisher(PoseStamped, BALL, 1)
        display.until(lambda: display.inbox.news.rivals == ("proximity_player",), "the other")
    finally:
        other.destroy_node()


def test_what_is_held_is_let_go_at_the_end(display, player, monkeypatch):
    monkeypatch.setattr(run, "FAREWELL_S", DEADLINE_S)
    node = player.start()
    display.holds.take("ball", HERE)
    display.until(lambda: released(node) == ["ball"], "the player to leave the ball alone")
    display.executor.remove_node(display.node)
    stop = threading.Event()
    stop.set()
    ending = threading.Thread(target=run._spin, args=(display.node, display.holds, stop))
    ending.start()
    display.until(lambda: not ending.is_alive(), "the end")
    assert released(node) == []


def test_a_body_that_the_scene_has_not_is_neither_published_nor_looked_for(display):
    display.holds.take("ghost", HERE)
    display.node._publish_held()
    display.node._look_around()
    display.holds.take("die", HERE)
    heard = []
    display.node.create_subscription(PoseStamped, DIE, heard.append, 1)
    display.until(lambda: heard, "the die's pose")


def test_another_scene_lets_all_go_and_what_was_shown_of_the_one_before_takes_none(display):
    display.holds.take("die", HERE)
    display.node._on_scene(String(data=json.dumps(SCENE | {"name": "other"})))
    assert not display.holds.poses
    assert not display.holds.take("die", HERE)
    display.holds.begin(display.inbox.news.scene.key)
    assert display.holds.take("die", HERE)


@pytest.fixture
def no_timer(monkeypatch):
    """The timer of held bodies does not fire while a test runs."""
    monkeypatch.setattr(module, "HELD_HZ", 1e-4)


def test_what_is_dragged_is_published_at_once(no_timer, display):
    heard = []
    display.node.create_subscription(PoseStamped, DIE, heard.append, 1)
    display.holds.take("die", HERE)

    def moved():
        display.holds.move("die", HERE)
        return heard

    display.until(moved, "the die's pose")


def test_what_fails_beside_the_page_ends_the_program_with_its_error(display):
    display.executor.remove_node(display.node)
    display.node.create_timer(0.001, lambda: 1 / 0)
    stop = threading.Event()
    with pytest.raises(ZeroDivisionError):
        run._spin(display.node, display.holds, stop)
    assert stop.is_set()


def test_a_tick_that_comes_is_shown_at_once(monkeypatch):
    monkeypatch.setattr(run, "FRAMES_HZ", 1e-4)
    monkeypatch.setattr(run, "LEAST_S", 1e4)  # a tick waits only after another tick
    inbox, stop, stepped = Inbox(), threading.Event(), threading.Semaphore(0)

    def step():
        inbox.read()
        stepped.release()

    thread = threading.Thread(target=run._frames, args=(SimpleNamespace(step=step), inbox, stop))
    thread.start()
    try:
        assert stepped.acquire(timeout=DEADLINE_S)
        inbox.put_pairs(b"....stampxxx....")
        inbox.put_poses(b"....stampxxx")
        assert stepped.acquire(timeout=DEADLINE_S)
    finally:
        stop.set()
        inbox.put_pairs(b"....stampyyy....")
        inbox.put_poses(b"....stampyyy")
        thread.join()


BROKEN = """
from proximity_monitor.display import node as module
from proximity_monitor.display import run

def broken(node, holds, stop):
    stop.set()
    raise ZeroDivisionError

run._spin = broken
run.main(["--ros-args", "-p", "port:=0"])
"""


@pytest.mark.long
def test_the_program_says_so_with_its_exit_code(ros_environment):
    ended = subprocess.run(
        [sys.executable, "-c", BROKEN], capture_output=True, text=True, timeout=DEADLINE_S
    )
    assert ended.returncode == 1
    assert "ZeroDivisionError" in ended.stderr


def test_the_monitor_is_asked_to_forget_its_smallest_clearances(display):
    display.node.reset_minima_of_monitor()
    assert "does not answer" in display.inbox.news.reset
    monitor, asked = rclpy.create_node("proximity_monitor", namespace=NAMESPACE), []

    def on_reset(request, response):
        asked.append(request)
        response.success, response.message = True, "reset the minima of 6 pairs"
        return response

    monitor.create_service(Trigger, "~/reset_minima", on_reset)
    display.executor.add_node(monitor)
    try:
        display.until(display.node._to_reset.service_is_ready, "the service")
        asked_s = -RETRY_S

        def answered():
            nonlocal asked_s
            # An answer is lost if the server has not discovered this client yet.
            if time.monotonic() > asked_s + RETRY_S:
                asked_s = time.monotonic()
                display.node.reset_minima_of_monitor()
            return display.inbox.news.reset == "the monitor reset the minima of 6 pairs"

        display.until(answered, "the answer")
        assert asked
    finally:
        display.executor.remove_node(monitor)
        monitor.destroy_node()


def test_a_player_that_ends_is_known_to_have_ended(display, player):
    display.node._look_around()
    assert not display.inbox.news.player_ended
    node = player.start()
    motion = {"moment_s": 1.0, "stamp_s": 5.0, "speed": 1.0, "period_s": 2.0}
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_publisher(String, "~/motion", latched).publish(String(data=json.dumps(motion)))
    display.until(lambda: display.inbox.news.playing is not None, "the motion")
    player.end(node)
    display.until(lambda: display.inbox.news.playing is None, "the end")
    assert display.inbox.news.player_ended
    again = player.start()
    again.create_publisher(String, "~/motion", latched).publish(String(data=json.dumps(motion)))
    display.until(lambda: display.inbox.news.playing is not None, "the next player")
    assert not display.inbox.news.player_ended


def test_a_scene_of_another_version_is_said_to_be_unreadable(display):
    display.node._on_scene(String(data="{}"))
    assert "same version" in display.inbox.news.unreadable["scene"]
    display.node._on_scene(String(data=json.dumps(SCENE)))
    assert not display.inbox.news.unreadable


def test_the_node_s_own_parameters_can_be_read(display):
    assert display.node.get_parameter("host").value == "127.0.0.1"
    assert "port" in display.node.list_parameters([], 0).names


@pytest.mark.parametrize("parameter", ["monitor", "player"])
def test_a_name_that_no_node_can_have_is_refused(rclpy_context, parameter):
    given = [Parameter(parameter, value="a b")]
    with pytest.raises(ParameterException, match=f"(?s)a b.*not a valid node name.*{parameter}"):
        ProximityDisplay(Inbox(), Holds(), parameter_overrides=given)

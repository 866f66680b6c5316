"""The installed executables as processes: starting, failing, lifecycle, ending."""

import json
import math
import re
import signal
import subprocess
import sys
import time

import pytest
from deadlines import START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")


from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import GetState
from rosgraph_msgs.msg import Clock

BROKEN = {
    "not_yaml": ("bodies: [", "not_yaml.yaml"),
    "key": ("version: 1\nframe: world\nunit: furlong\n", "unit"),
    "model": (
        "version: 1\nframe: world\nunit: m\nbodies:\n"
        "  - {name: a, model: nowhere.stl, pose: {position: [0, 0, 0]}}\n"
        "  - {name: b, primitive: {sphere: {radius: 1}}, moving: true}\npairs: all\n",
        "nowhere.stl",
    ),
}
"""Unusable scenes, and a part of the message about each."""
BROKEN["torn"] = (BROKEN["model"][0].replace("nowhere", "torn"), "torn.stl")
BAD = {
    "rate_hz": -3.0,
    "budget_ms": "often",
    "rel_err": -0.5,
    "thresholds.warn": 0.001,  # below stop
    "pairs.ball.die.stop": -1.0,
}
"""Bad values of parameters at start."""
BEGIN = """
import json, sys
from proximity_monitor.ros.node import main

for name, given in json.loads(sys.argv[1]).items():
    arguments = [part for key in given for part in ("-p", f"{key}:={given[key]}")]
    code = main(["--ros-args", *arguments])
    print(f"{name} ends with {code}", file=sys.stderr, flush=True)
"""
PROMPT_S = 15.0  # half a second on an idle machine


@pytest.fixture(scope="module")
def begun(ros_environment, scene_file, tmp_path_factory):
    """Run the node in one process, once per scene and parameter; return code and text by name.

    Another test shows that the program ends with this exit code.
    """
    folder = tmp_path_factory.mktemp("broken")
    (folder / "torn.stl").write_bytes(b"\x00\x01 no mesh")
    for name, (text, _) in BROKEN.items():
        (folder / f"{name}.yaml").write_text(text)
    scenes = {name: {"scene": str(folder / f"{name}.yaml")} for name in BROKEN}
    given = scenes | {name: {"scene": str(scene_file), name: BAD[name]} for name in BAD}
    command = [sys.executable, "-c", BEGIN, json.dumps(given)]
    log = folder / "log"
    with log.open("w") as file:
        subprocess.run(command, stdout=file, stderr=file, timeout=START_DEADLINE_S, check=True)
    found, text = {}, log.read_text()
    for name in given:
        told, _, text = text.partition(f"{name} ends with ")
        code, _, text = text.partition("\n")
        found[name] = int(code), told
    return found


@pytest.mark.parametrize("name", BROKEN)
def test_a_scene_that_cannot_be_used_ends_the_node_with_a_message(begun, name):
    code, text = begun[name]
    assert code == 1
    assert BROKEN[name][1] in text
    assert "Traceback" not in text


@pytest.mark.parametrize("name", BAD)
def test_a_bad_parameter_at_start_ends_the_node_with_a_message(begun, name):
    code, text = begun[name]
    assert code == 1
    assert name.rpartition(".")[0] in text
    assert name.rpartition(".")[2] in text
    assert "Traceback" not in text
    assert "atomic" not in text, "a call is no way out before it runs"


@pytest.mark.long
@pytest.mark.parametrize("name", ["node", "player"])
def test_what_libraries_do_as_they_are_unloaded_crashes_nothing(run, executable, tmp_path, name):
    program = (
        "import atexit, os, runpy, sys\n"
        "atexit.register(os.abort)  # as the middleware did, one time of a thousand\n"
        "runpy.run_path(sys.argv[1], run_name='__main__')"
    )
    scene = f"scene:={tmp_path / 'missing.yaml'}"
    process = run(sys.executable, "-c", program, executable(name), "--ros-args", "-p", scene)
    assert process.ended() == 1
    assert "missing.yaml" in process.text
    assert "Traceback" not in process.text


@pytest.mark.long
def test_a_real_number_may_be_given_as_a_whole_one(launch, scene_file, new_peer):
    whole = {"rel_err": 0, "rate_hz": 40, "thresholds.hold_s": 1}
    process = launch("node", "-r", "__ns:=/whole", **{"scene": scene_file, **whole})
    peer = new_peer(process, "whole")
    peer.settle()
    assert peer.health(peer.next("diagnostics"))["schedule"]["rate_hz"] == "40"
    assert peer.set_parameters(rate_hz=25, thresholds__warn=1) == (True, "")
    assert peer.health(peer.next("diagnostics"))["schedule"]["rate_hz"] == "25"
    assert not peer.set_parameters(tick_on_pose=1)[0]


def test_a_signal_ends_an_active_node_cleanly(launch, scene_file, new_peer):
    process = launch("node", "-r", "__ns:=/ends", scene=scene_file)
    peer = new_peer(process, "ends")
    peer.settle()
    code, took_s = process.stop(signal.SIGINT)
    assert code == 0, process.text
    assert took_s < PROMPT_S
    assert "Traceback" not in process.text


@pytest.mark.long
def test_a_signal_ends_a_node_that_still_compiles(launch, scene_file, tmp_path, new_peer):
    empty = {"NUMBA_CACHE_DIR": str(tmp_path)}
    process = launch("node", "-r", "__ns:=/cold", scene=scene_file, environment=empty)
    peer = new_peer(process, "cold")

    def topics():
        return {name for name, _ in peer.node.get_topic_names_and_types()}

    def progress():
        text = peer.health().get("schedule", {"text": ""})["text"]
        return re.fullmatch(r"compiling kernels: (\d+) of (\d+): no clearance is watched", text)

    peer.wait(progress, "the diagnostics to say how far it is", START_DEADLINE_S)
    assert 0 <= int(progress()[1]) < int(progress()[2])
    peer.wait(lambda: "/cold/proximity_monitor/closest_points" in topics(), "the topics")
    code, took_s = process.stop(signal.SIGINT)
    assert code == 0, process.text
    assert took_s < PROMPT_S
    (told,) = [line for line in process.text.splitlines() if "for this machine" in line]
    assert told.startswith("[WARN]"), "it goes through the node's own log"
    assert str(tmp_path) in told
    assert "Traceback" not in process.text
    assert process.text.endswith("proximity_monitor: ended by SIGINT\n")


def test_a_signal_at_any_moment_ends_it_with_a_line(launch, new_peer):
    """The later signals arrive while models are read, kernels are loaded or the watch begins.

    Both kinds of signal have the same handler, so they take turns.
    """
    delays_s = (0.0, 0.1, 0.2, 0.3, 0.4, 0.8)
    kinds = 3 * (signal.SIGINT, signal.SIGTERM)
    processes = [launch("node", "-r", f"__ns:=/any{i}", scene="engine") for i in range(6)]
    begun = {}
    peer = new_peer(processes[0], "any")

    def told():
        for process, kind, delay_s in zip(processes, kinds, delays_s, strict=True):
            if process not in begun and "preparing the search" in process.text:
                begun[process] = time.monotonic() + delay_s
            if time.monotonic() >= begun.get(process, math.inf):
                begun[process] = math.inf
                process.popen.send_signal(kind)
        return all(at == math.inf for at in begun.values()) and len(begun) == len(processes)

    peer.monitor.popen.poll = lambda: None  # `wait` must not fail because it ends
    peer.wait(told, "all to be told to end", 180.0)
    for process, kind in zip(processes, kinds, strict=True):
        process.popen.wait(60.0)
        assert process.popen.returncode == 0, process.text
        assert process.text.endswith(f"proximity_monitor: ended by {kind.name}\n")
        for wrong in ("Traceback", "rror", "FATAL", "not a readable", "ignored"):
            assert wrong not in process.text


def test_an_interrupt_that_comes_up_as_another_error_is_one_all_the_same(run):
    """Numba's compiler and file readers report an exception raised below them as bad input."""
    code = (
        "import signal, sys\n"
        "from proximity_monitor.ros.spin import interruptible, ros\n"
        "with ros([], 'it'), interruptible():\n"
        "    try:\n"
        "        signal.raise_signal(signal.SIGINT)\n"
        "    except BaseException as error:\n"
        "        raise ValueError('not a readable file') from error\n"
    )
    process = run(sys.executable, "-c", code)
    assert process.ended() == 0
    assert process.text == "it: ended by SIGINT\n"


def test_a_signal_ends_a_node_that_waits_to_be_configured(launch, scene_file, new_peer):
    process = launch("node", "-r", "__ns:=/waits", scene=scene_file, autostart="false")
    state = new_peer(process, "waits").call(GetState, "get_state", GetState.Request())
    assert state.current_state.id == State.PRIMARY_STATE_UNCONFIGURED
    code, took_s = process.stop(signal.SIGTERM)
    assert code == 0, process.text
    assert took_s < PROMPT_S


def test_a_lifecycle_manager_can_drive_it_through_its_states(launch, scene_file, new_peer):
    process = launch("node", "-r", "__ns:=/led", scene=scene_file, autostart="false")
    peer = new_peer(process, "led")

    def state():
        return peer.call(GetState, "get_state", GetState.Request()).current_state.label

    def names():
        return {name for name, _ in peer.node.get_topic_names_and_types()}

    for _ in range(2):
        assert peer.change(Transition.TRANSITION_CONFIGURE)
        assert state() == "inactive"
        schedule = peer.wait(
            lambda: (s := peer.health().get("schedule")) and s["activity"] == "inactive" and s,
            "diagnostics of an inactive node",
        )
        assert "no clearance is watched" in schedule["text"]
        assert peer.change(Transition.TRANSITION_ACTIVATE)
        assert {pair["state"] for pair in peer.settle().values()} == {"clear"}
        assert not peer.set_parameters(scene="engine")[0]

        assert peer.change(Transition.TRANSITION_DEACTIVATE)
        peer.wait(
            lambda: (m := peer.last("markers")) and all(each.action == 2 for each in m.markers),
            "the marks to be taken down",
        )
        assert peer.change(Transition.TRANSITION_CLEANUP)
        assert state() == "unconfigured"
        peer.forget()
        assert peer.set_parameters(fixed_frame="cell") == (True, "")
        done, _ = peer.set_parameters(thresholds__warn=0.2)
        assert not done, "thresholds belong to a configured scene"

    assert peer.change(Transition.TRANSITION_UNCONFIGURED_SHUTDOWN)
    assert state() == "finalized"
    assert process.stop(signal.SIGINT)[0] == 0


@pytest.mark.long
def test_a_scene_that_fails_to_configure_can_be_replaced(launch, scene_file, tmp_path, new_peer):
    process = launch("node", "-r", "__ns:=/again", scene=tmp_path / "none.yaml", autostart="false")
    peer = new_peer(process, "again")
    assert not peer.change(Transition.TRANSITION_CONFIGURE)
    assert peer.set_parameters(scene=str(scene_file)) == (True, "")
    assert peer.change(Transition.TRANSITION_CONFIGURE)


@pytest.mark.long
def test_simulated_time_stamps_the_results_and_may_not_stand_still(launch, scene_file, new_peer):
    process = launch("node", "-r", "__ns:=/sim", scene=scene_file, use_sim_time="true")
    peer = new_peer(process, "sim")
    clock = peer.node.create_publisher(Clock, "/clock", 1)
    message, time_s = Clock(), 1000

    def tell(at_s, states, step_ns=10_000):
        message.clock.nanosec += step_ns
        message.clock.sec = at_s
        clock.publish(message)
        for name, position in (("ball", (0.0, 0.0, 0.5)), ("die", (0.8, 0.1, 0.9))):
            pose = peer.pose(position)
            pose.header.stamp = message.clock
            peer.publish(**{name: pose})
        told = peer.last("closest_points")
        found = {pair["state"] for pair in peer.pairs().values()}
        return told is not None and told.header.stamp.sec == at_s and found == states

    peer.wait(
        lambda: tell(time_s, {"clear"}), "results stamped with simulated time", START_DEADLINE_S
    )
    peer.wait(lambda: tell(time_s + 3600, {"clear"}), "results after a jump ahead")
    peer.wait(lambda: tell(10, {"clear"}), "results after the clock went back")
    assert "clock went back" in process.text

    def inputs():
        return peer.health().get("inputs", {"text": ""})

    # As in a paused simulation whose sources go on publishing.
    peer.wait(lambda: tell(10, {"stale"}, step_ns=0), "all to be stale as time stands still")
    assert all("no new time on /clock" in pair["text"] for pair in peer.pairs().values())
    peer.wait(
        lambda: tell(10, {"stale"}, step_ns=0) and "/clock" in inputs()["text"],
        "the diagnostics to say so",
    )
    peer.wait(lambda: tell(10, {"clear"}), "all to be clear as time goes on")


def test_the_player_publishes_the_motion_with_stamps(launch, new_peer, rclpy_context):
    from geometry_msgs.msg import PoseStamped

    from proximity_monitor import motion, scene

    process = launch("player", "-r", "__ns:=/played", rate_hz=50.0, speed=0.5)
    peer = new_peer(process, "played")
    described = scene.load_scene(scene.bundled("engine"))
    moved = motion.from_scene(described)
    got = {}
    for body in described.bodies:
        if body.moving:
            peer.node.create_subscription(
                PoseStamped, body.topic, lambda m, n=body.name: got.setdefault(n, []).append(m), 10
            )
    peer.wait(
        lambda: len(got) == 5 and all(len(m) > 5 for m in got.values()), "poses", START_DEADLINE_S
    )
    assert set(got) == set(moved.bodies)
    for messages in got.values():
        assert {m.header.frame_id for m in messages} == {described.frame}
        stamps = [m.header.stamp.sec + m.header.stamp.nanosec * 1e-9 for m in messages]
        assert stamps == sorted(stamps)
    places = {round(m.pose.position.z, 9) for m in got["piston_1"]}
    assert len(places) > 1, "the piston moves"
    assert moved.describe() in process.text
    assert process.stop(signal.SIGINT)[0] == 0
    assert "Traceback" not in process.text


def test_the_player_ends_after_one_period_if_it_is_not_to_loop(launch):
    process = launch("player", "-r", "__ns:=/once", speed=50.0, loop="false")
    assert process.ended() == 0


CUT = """
import os, signal, sys
from proximity_monitor.ros.spin import interruptible, ros

class Fragile:
    def __del__(self, end=os._exit):
        end(7)

def link():
    module = Fragile()
    os.kill(os.getpid(), signal.SIGINT)
    while True:
        pass

sys.kept = Fragile()
with ros(name="cut"), interruptible():
    try:
        link()
    except BaseException:
        if sys.argv[1:] != ["swallowed"]:
            raise
print("all is said")
"""


@pytest.mark.parametrize("how", ["raised", "swallowed"])
def test_what_an_interrupt_cut_is_never_destroyed(ros_environment, how):
    """The destructor of an LLVM object crashes if a signal cut its constructor or its owner."""
    run = subprocess.run(
        [sys.executable, "-c", CUT, how],
        env=ros_environment,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (run.returncode, run.stdout) == (0, "all is said\n")
    assert run.stderr == "cut: ended by SIGINT\n"


@pytest.mark.long
def test_a_body_that_moves_from_rest_has_its_tick_at_once(launch, scene_file, new_peer):
    """Such as a body moved by hand. Otherwise it would wait for the timer or all other poses."""
    slow = {"scene": scene_file, "rate_hz": 0.5, "pose_timeout_s": 600.0}
    peer = new_peer(launch("node", "-r", "__ns:=/prompt", **slow), "prompt")
    peer.settle()
    peer.hold()
    took = [math.inf]
    while min(took) >= 0.4 and len(took) < 4:  # a busy machine may delay one
        height = 0.5 + 0.1 * len(took)
        for _ in range(2):  # two equal poses: the body rests
            peer.publish(ball=(0.0, 0.0, height))
            peer.next("closest_points", START_DEADLINE_S)
        ends = time.monotonic() + 1.2  # in the second half of a period, when it may tick at once
        peer.wait(lambda ends=ends: time.monotonic() > ends, "more than half of a period")
        began = time.monotonic()
        peer.publish(ball=(0.0, 0.0, height + 0.05))
        lower_m = height - 0.06
        peer.wait(lambda m=lower_m: float(peer.pairs()["table - ball"]["lower_m"]) > m, "the tick")
        took.append(time.monotonic() - began)
    assert min(took) < 0.4, took

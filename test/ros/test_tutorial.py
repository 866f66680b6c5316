"""The tutorial, run as a new user follows it, and docs/node.md against the running node."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from deadlines import START_DEADLINE_S

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")

ROOT = Path(__file__).resolve().parents[2]
TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
NODE = (ROOT / "docs" / "node.md").read_text(encoding="utf-8")


def blocks(information):
    """Return the tutorial's fenced blocks that have this text after the opening back-ticks."""
    return re.findall(rf"^```{re.escape(information)}\n(.*?)^```", TUTORIAL, re.M | re.S)


def rows(heading):
    """Return the cells of the first table under a heading of docs/node.md, without back-ticks."""
    text = NODE.partition(f"\n## {heading}\n")[2]
    lines = re.search(r"(?:^\|.*\n)+", text, re.M)[0].splitlines()[2:]
    return [
        [cell.strip().replace("`", "") for cell in line.strip("|").split("|")] for line in lines
    ]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Make the tutorial's folder inside a stand-in for the repository."""
    root = tmp_path_factory.mktemp("repository")
    (root / "examples").symlink_to(ROOT / "examples")
    made = root / "build" / "tutorial"
    made.mkdir(parents=True)
    return made


@pytest.fixture(scope="module")
def printed(ros_environment, launch_for_all, folder):
    """Run the tutorial's commands in order, the last two beside the node; return their output."""
    install, *commands = [block.strip() for block in blocks("sh")]
    assert install.startswith("make demo ") and install.endswith("cd build/tutorial")
    (scene,) = blocks('yaml title="cell.yaml"')
    (folder / "cell.yaml").write_text(scene)
    (node,) = blocks('sh title="the other terminal"')
    assert node == '"$VIRTUAL_ENV"/lib/proximity_monitor/node --ros-args -p scene:=cell.yaml\n'
    environment = os.environ | {"VIRTUAL_ENV": sys.prefix}
    apart = str(int(os.environ["ROS_DOMAIN_ID"]) % 100 + 1)  # the demo's node has the same name

    def start(command):
        demo = " demo " in command
        return subprocess.Popen(
            ["bash", "-ec", f"exec {command}{' --no-page' if demo else ''}"],
            cwd=folder,
            env=environment | ({"ROS_DOMAIN_ID": apart} if demo else {}),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    *first, demo, move = commands
    said = [_end(start(command)) for command in first]
    # The tutorial starts the node in this folder, so scene:=cell.yaml means this file.
    launch_for_all("node", scene=folder / "cell.yaml")
    together = start(demo), start(move)
    return said + [_end(process) for process in together]


def _end(process):
    text, _ = process.communicate(timeout=START_DEADLINE_S)
    assert process.returncode == 0, text
    return text


def test_every_command_prints_what_the_tutorial_says(printed):
    """Each line that the tutorial shows begins a printed line; `...` stands for any text.

    On a busy machine the pin may fall silent for a moment, so alerts may come twice.
    """
    shown = [block.splitlines() for block in blocks("text")]
    assert len(printed) == 5 and len(shown) == 4
    for text, expected in zip(printed[1:], shown, strict=True):
        for line in expected:
            assert re.search(_pattern(line), text, re.M), f"{line!r} is not in:\n{text}"


def test_the_tutorial_shows_every_line_but_of_the_demo(printed):
    """On a busy machine the pin may fall silent; the tutorial does not show the alerts of this."""
    clearance, check, _, move = (block.splitlines() for block in blocks("text"))
    said = zip((printed[1], printed[2], printed[4]), (clearance, check, move), strict=True)
    for text, shown in said:
        for line in text.splitlines():
            known = any(re.match(_pattern(each), line) for each in shown)
            assert known or line.startswith("ring - pin: "), f"{line!r} is not in the tutorial"


def _pattern(line):
    """Return the regular expression for a line of the tutorial, with any count of alerts."""
    often, told = re.fullmatch(r"\s*(1 x )?(.*)", line).groups()
    pattern = r"^\s*" + (r"\d+ x " if often else "")
    return pattern + ".*".join(map(re.escape, told.split("...")))


@pytest.fixture(scope="module")
def peer(printed, rclpy_context):
    import rclpy

    made = rclpy.create_node("reader")
    yield made
    made.destroy_node()


def _wait(peer, condition):
    """Spin until a condition returns something true, and return that."""
    import rclpy

    for _ in range(int(START_DEADLINE_S / 0.05)):
        if found := condition():
            return found
        rclpy.spin_once(peer, timeout_sec=0.05)
    pytest.fail("the node is not heard")


def _ends(peer, side):
    """Return type and QoS of the monitor's topics on one side, in the words of docs/node.md."""
    found = {}
    for topic, _ in peer.get_topic_names_and_types():
        for end in getattr(peer, f"get_{side}_info_by_topic")(topic):
            if end.node_name == "proximity_monitor":
                qos = end.qos_profile
                words = "best effort" if qos.reliability.name == "BEST_EFFORT" else "reliable"
                if qos.durability.name == "TRANSIENT_LOCAL":
                    words = "latched"
                name = topic.replace("/proximity_monitor/", "~/")
                found[name] = end.topic_type.replace("/msg/", "/"), words
    return found


def test_topics_out(peer):
    told = {topic: (kind, qos.partition(",")[0]) for topic, kind, qos, _ in rows("Topics out")}
    _wait(peer, lambda: told.keys() <= _ends(peer, "publishers").keys())
    found = _ends(peer, "publishers")
    of_ros = {"/rosout", "/parameter_events", "~/transition_event"}
    assert {topic: ends for topic, ends in found.items() if topic not in of_ros} == told


def test_topics_in(peer):
    told = {topic: (kind, qos.partition(",")[0]) for topic, kind, qos, _ in rows("Topics in")}
    found = _wait(peer, lambda: _ends(peer, "subscriptions"))
    assert found == {
        "/bodies/pin/pose": told["bodies/<name>/pose"],
        "/poses": told["poses"],
    }


def test_services(peer):
    told = {name.replace("~", "/proximity_monitor"): kind for name, kind, _ in rows("Services")}

    def own():
        if "proximity_monitor" not in peer.get_node_names():
            return {}  # its topics may be known sooner than its name
        served = peer.get_service_names_and_types_by_node("proximity_monitor", "/")
        return {
            name: kinds[0].replace("/srv/", "/")
            for name, kinds in served
            if kinds[0].startswith("std_srvs")
        }

    _wait(peer, lambda: told.keys() <= own().keys())
    assert own() == told


def test_parameters(peer):
    from rcl_interfaces.srv import ListParameters

    from proximity_monitor.ros.parameters import SPECS

    _, *tables = NODE.partition("\n## Parameters\n")[2].split("| name | default | what |")
    told = {}
    for name, default, _ in rows("Parameters"):
        told[name] = default
    assert told.keys() == SPECS.keys()
    for name, spec in SPECS.items():
        default = spec.default
        text = str(default).lower() if isinstance(default, bool) else f"{default or '(empty)'}"
        assert told[name] == text.removesuffix(".0"), name

    client = peer.create_client(ListParameters, "/proximity_monitor/list_parameters")
    _wait(peer, client.service_is_ready)
    answer = client.call_async(ListParameters.Request())
    names = set(_wait(peer, lambda: answer.done() and answer.result()).result.names)
    of_ros = {"use_sim_time", "start_type_description_service"}
    limits = {f"thresholds.{limit}" for limit in ("warn", "stop", "hysteresis", "hold_s")}
    assert names - of_ros == told.keys() | limits | {"attachments.pin"}
    assert "`attachments.<child>`" in tables[1] and "`thresholds.warn`, `.stop`" in tables[1]


def test_parameters_of_the_player(rclpy_context, folder, printed):
    from rclpy.parameter import Parameter

    from proximity_monitor.ros.player import ProximityPlayer

    scene = Parameter("scene", value=str(folder / "cell.yaml"))
    player = ProximityPlayer(parameter_overrides=[scene])
    try:
        names = set(player._parameters) - {"use_sim_time", "start_type_description_service"}
        told = {name: default for name, default, _ in rows("The player")}
        assert told.keys() == names
        for name in names - {"scene", "released"}:
            value = player.get_parameter(name).value
            text = str(value).lower() if isinstance(value, bool) else f"{value}" or "(empty)"
            assert told[name] == text.removesuffix(".0"), name
    finally:
        player.destroy_node()


def test_what_the_diagnostics_tell():
    """Every reason for a refused message that docs/troubleshooting.md names exists."""
    from proximity_monitor.ros.inputs import Reason

    page = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
    named = re.findall(r"`rejected: ([\w ]+)`", page)
    assert len(named) == 4
    assert set(named) <= set(Reason.ALL)

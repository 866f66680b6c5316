"""Poses from bags that rosbags wrote, in both storages, and bags that do not fit their scene."""

import sys

import numpy as np
import pytest

from proximity_monitor import motion, scene

pytest.importorskip("rosbags", reason="rosbags is not installed: pip install '.[bag]'")

import recorded_bags as bags
from recorded_bags import array, stamped
from rosbags.rosbag2 import CompressionMode, Reader, StoragePlugin

SCENE = """
version: 1
unit: mm
frame: cell
bodies:
  - {name: tool, primitive: {box: {size: [1, 1, 1]}}, topic: /tool}
  - {name: left, primitive: {box: {size: [1, 1, 1]}}, moving: true}
  - {name: right, primitive: {box: {size: [1, 1, 1]}}, moving: true}
motion:
  bag:
    path: taken
    topics:
      /tool: tool
      /fingers: [right, left]
"""
QUARTER = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
TOOL = [stamped(0.0, (1, 0, 0)), stamped(1.0, (2, 0, 0), QUARTER), stamped(4.0, (3, 0, 0))]
FINGERS = [array(0.5, (0, 1, 0), (0, 2, 0)), array(1.5, (0, 3, 0), (0, 4, 0))]


@pytest.fixture(params=[StoragePlugin.MCAP, StoragePlugin.SQLITE3], ids=["mcap", "sqlite3"])
def storage(request):
    return request.param


@pytest.fixture
def load(tmp_path):
    def load(more=""):
        path = tmp_path / "scene.yaml"
        path.write_text(SCENE + more)
        return motion.from_scene(scene.load_scene(path))

    return load


@pytest.fixture
def taken(tmp_path):
    """Return a function that writes a bag that fits the scene."""

    def write(storage=StoragePlugin.MCAP, tool=TOOL, fingers=FINGERS, **others):
        return bags.write(tmp_path / "taken", storage, tool=tool, fingers=fingers, **others)

    return write


def places(made, t):
    return {name: tuple(pose[:3, 3]) for name, pose in made.poses(t).items()}


def test_the_last_recorded_pose_is_held(load, taken, storage):
    taken(storage)
    made = load()
    assert made.bodies == ("tool", "right", "left")
    assert made.period_s == 4.0
    assert made.describe() == "bag: 3 bodies, taken, 4 s in a loop"
    assert places(made, 0.0) == {"tool": (1.0, 0.0, 0.0)}  # nothing else was heard of yet
    assert places(made, 0.999)["tool"] == (1.0, 0.0, 0.0)
    assert places(made, 1.25) == {"tool": (2, 0, 0), "right": (0, 1, 0), "left": (0, 2, 0)}
    assert places(made, 3.0) == {"tool": (2, 0, 0), "right": (0, 3, 0), "left": (0, 4, 0)}
    turned = made.poses(1.0)["tool"]
    np.testing.assert_allclose(turned[:3, 0], [0.0, 1.0, 0.0], atol=1e-15)
    assert np.abs(turned[:3, :3] @ turned[:3, :3].T - np.eye(3)).max() < 1e-15


@pytest.mark.parametrize("suffix", [".mcap", ".db3"])
def test_a_single_file_will_do(load, taken, tmp_path, suffix):
    storage = StoragePlugin.MCAP if suffix == ".mcap" else StoragePlugin.SQLITE3
    (file,) = taken(storage).glob(f"*{suffix}")
    (tmp_path / "scene.yaml").write_text(SCENE.replace("path: taken", f"path: {file}"))
    made = motion.from_scene(scene.load_scene(tmp_path / "scene.yaml"))
    assert places(made, 1.5) == {"tool": (2, 0, 0), "right": (0, 3, 0), "left": (0, 4, 0)}
    assert made.period_s == 4.0


def test_it_begins_again_at_its_end(load, taken):
    taken()
    made = load()
    assert places(made, 4.25) == places(made, 0.25)
    assert places(made, 9.25) == places(made, 1.25)
    assert places(made, -2.75) == places(made, 1.25)
    last = {"tool": (3, 0, 0), "right": (0, 3, 0), "left": (0, 4, 0)}
    for end in (4.0, 8.0):  # the last pose is shown before it begins again
        assert places(made, end) == last
    assert places(made, 4.0 + 1e-9) == places(made, 0.0)


def test_played_once_it_rests_at_its_end(load, taken):
    taken()
    made = load("    loop: false\n")
    assert places(made, 100.0) == {"tool": (3, 0, 0), "right": (0, 3, 0), "left": (0, 4, 0)}
    assert places(made, -1.0) == {}
    assert made.describe() == "bag: 3 bodies, taken, 4 s once"


def test_rate_and_seek(load, taken):
    taken()
    made = load("    rate: 2\n    seek_s: 1.25\n")
    assert made.period_s == pytest.approx(1.375)
    assert made.describe() == "bag: 3 bodies, taken, 2.75 s at rate 2 in a loop"
    # The last poses in the skipped part are held, as those of a latched topic are.
    assert places(made, 0.0) == {"tool": (2, 0, 0), "right": (0, 1, 0), "left": (0, 2, 0)}
    assert places(made, 0.2) == {"tool": (2, 0, 0), "right": (0, 3, 0), "left": (0, 4, 0)}
    assert places(made, 1.376) == places(made, 0.0)


@pytest.mark.parametrize("rate", [0.3, 0.7, 1.1, 7.0])
def test_rounding_does_not_cost_the_last_pose(load, taken, rate):
    taken(tool=[stamped(0.0, (1, 0, 0)), stamped(0.7, (2, 0, 0)), stamped(12.3, (3, 0, 0))])
    made = load(f"    rate: {rate}\n    seek_s: 0.1\n    loop: false\n")
    assert places(made, made.period_s)["tool"] == (3, 0, 0)


def test_a_quaternion_is_made_unit_exactly(load, taken):
    taken(tool=[stamped(0.0, (0, 0, 0), (0.0, 0.0, 0.6004, 0.8004))])
    rotation = load().poses(0.0)["tool"][:3, :3]
    assert np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-15


def test_a_bag_of_one_moment_has_no_period(load, taken):
    taken(tool=[stamped(0.0, (1, 0, 0))], fingers=[array(0.0, (0, 1, 0), (0, 2, 0))])
    made = load()
    assert made.period_s is None
    assert places(made, 8.0)["left"] == (0, 2, 0)


BAD = {
    "other frame": (
        {"tool": [TOOL[0], stamped(1.0, (0, 0, 0), frame="world")]},
        "taken: /tool: message 2 is in frame 'world', but the scene in 'cell'",
    ),
    "poses where a list is named": (
        {"fingers": TOOL},
        "taken: /fingers: has messages of type geometry_msgs/msg/PoseStamped; .* a list of names",
    ),
    "a list where one is named": (
        {"tool": FINGERS},
        "taken: /tool: has messages of type geometry_msgs/msg/PoseArray; a single name needs",
    ),
    "another type": (
        {"tool": [(0.0, bags.header(0.0, "cell"))]},
        "taken: /tool: has messages of type std_msgs/msg/Header; a single name needs",
    ),
    "no message": ({"tool": []}, "taken: /tool: the bag has no messages on this topic"),
    "another number of poses": (
        {"fingers": [FINGERS[0], array(1.0, (0, 0, 0))]},
        "taken: /fingers: message 2 has 1 poses, but the scene names 2 bodies",
    ),
    "not finite": (
        {"tool": [TOOL[0], stamped(1.0, (0, float("nan"), 0))]},
        "taken: /tool: message 2 has a pose that is not finite, or .*nan",
    ),
    "not unit": (
        {"tool": [stamped(0.0, (0, 0, 0), (0, 0, 0, 0))]},
        "taken: /tool: message 1 has a pose that is not finite, or whose quaternion",
    ),
    "beyond all numbers": (
        {"tool": [stamped(0.0, (0, 0, 0), (1e200, 0, 0, 1e200))]},
        "taken: /tool: message 1 has a pose that is not finite, or whose quaternion",
    ),
    "garbage": (
        {"tool": [TOOL[0], (1.0, b"\0\1\0\0garbage")]},
        "taken: /tool: message 2 cannot be read as geometry_msgs/msg/PoseStamped",
    ),
}


@pytest.mark.parametrize("changes, words", BAD.values(), ids=BAD)
def test_a_bag_that_does_not_fit_is_refused_by_file_and_topic(load, taken, storage, changes, words):
    taken(storage, **changes)
    with pytest.raises(ValueError, match=words):
        load()


def test_a_topic_that_is_not_there_is_told_with_those_that_are(load, tmp_path, storage):
    bags.write(tmp_path / "taken", storage, tools=TOOL, fingers=FINGERS)
    with pytest.raises(ValueError, match=r"taken: /tool: no such topic .* it has /fingers, /tools"):
        load()


def test_seeking_beyond_the_end_is_refused(load, taken):
    taken()
    with pytest.raises(
        ValueError, match=r"taken: lasts 4 s, so nothing is left to play after seek_s, 5 s"
    ):
        load("    seek_s: 5\n")


@pytest.mark.parametrize("name", ["taken", "taken.mcap", "taken.db3", "taken.txt"])
def test_what_is_no_bag_is_refused(tmp_path, name):
    path = tmp_path / name
    if name == "taken":
        path.mkdir()
    else:
        path.write_bytes(b"\x89MCAP0\r\nSQLite format 3\0" * 9)
    (tmp_path / "scene.yaml").write_text(SCENE.replace("path: taken", f"path: {name}"))
    with pytest.raises(ValueError, match=f"{name}: .* a ROS 2 bag"):
        motion.from_scene(scene.load_scene(tmp_path / "scene.yaml"))


def test_stamps_of_messages_may_run_back(load, taken):
    """Two publishers cause this, or a simulation that starts again. The time of receipt counts."""
    taken(tool=[TOOL[0], (2.0, TOOL[2][1]), (3.0, TOOL[1][1])])
    made = load()
    assert places(made, 2.5)["tool"] == (3, 0, 0)
    assert places(made, 3.0)["tool"] == (2, 0, 0)


def test_a_bag_that_lost_messages_is_refused(load, taken, monkeypatch):
    taken()
    kept = Reader.messages
    monkeypatch.setattr(Reader, "messages", lambda bag, used: list(kept(bag, used))[1:])
    with pytest.raises(ValueError, match=r"taken: /tool: 2 of 3 messages can be read, so the bag"):
        load()


def test_a_damaged_bag_is_refused(load, taken, storage):
    (file,) = (each for each in taken(storage).iterdir() if each.suffix != ".yaml")
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ValueError, match="taken: cannot be read as a ROS 2 bag"):
        load()


def test_without_rosbags_it_says_what_to_install(load, taken, monkeypatch):
    taken()
    for name in [name for name in sys.modules if name.partition(".")[0] == "rosbags"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(ValueError, match=r"pip install '\.\[bag\]'"):
        load()


@pytest.mark.parametrize("t", [float("nan"), float("inf")])
def test_time_must_be_finite(load, taken, t):
    taken()
    with pytest.raises(ValueError, match=rf"t: must be finite \(got {t}\)"):
        load().poses(t)


@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_a_compressed_bag_is_read_by_its_folder(load, taken, tmp_path, mode):
    """One file of the bag does not say how it is compressed; metadata.yaml alone is no bag."""
    folder = taken(StoragePlugin.SQLITE3, compression=mode)
    assert load().period_s == 4.0
    file, metadata = sorted(folder.iterdir(), key=lambda each: each.name == "metadata.yaml")
    for each in (file, metadata):
        with pytest.raises(
            ValueError, match=r"give the bag's folder, whose metadata\.yaml"
        ) as told:
            motion.from_scene(scene.load_scene(_named(tmp_path, f"taken/{each.name}")))
        assert each.name in str(told.value)


def _named(folder, bag):
    path = folder / "scene.yaml"
    path.write_text(SCENE.replace("path: taken", f"path: {bag}"))
    return path

"""Which messages of a browser the page accepts; it ignores all others."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not importable: these tests need ROS 2")
pytest.importorskip("viser", reason="viser is not installed: pip install '.[display]'")

import viser
from raw_browser import CAMERA, RawBrowser

from proximity_monitor.display.intake import BYTES, TEXT, Intake

BAD = (
    "nobody at all",
    "x" * (TEXT + 1),
    1e300,
    -(2**63),
    float("nan"),
    float("inf"),
    None,
    {"a": 1},
    [1.0, float("nan"), 3.0],
    [1e300, 0.0, 0.0],
    [1.0],
    b"bytes",
)


@pytest.fixture
def page(alone):
    return alone


def test_no_input_takes_what_it_could_not_show(page, raw, server):
    found = raw.inputs()
    assert {type(each).__name__ for each in found} >= {
        "GuiTextHandle", "GuiDropdownHandle", "GuiSliderHandle", "GuiVector3Handle",
        "GuiCheckboxHandle", "GuiButtonHandle",
    }  # fmt: skip
    before = [each.value for each in found]
    for each in found:
        for value in BAD:
            if not (isinstance(each.value, str) and value == BAD[0] and "Text" in str(type(each))):
                raw.set(each, value)
    raw.heard(server)
    page.tell()
    assert page.logged == []
    for each, value in zip(found, before, strict=True):
        np.testing.assert_array_equal(each.value, value, err_msg=str(each))


def test_every_field_says_what_it_is_for_where_a_browser_shows_that(page, raw):
    """A browser shows no hint for a button, so a button's label must say everything."""
    fields = [each for each in raw.inputs() if getattr(each, "label", None) != "pressed"]
    buttons = [each for each in fields if isinstance(each, viser.GuiButtonHandle)]
    assert [each.label for each in buttons if each.hint] == []
    assert [each.label for each in fields if each not in buttons and not each.hint] == []


def test_no_browser_changes_what_is_not_a_value_or_another_s(page, raw, server):
    """`other` connects after `raw`, and its inputs must stay unchanged too."""
    other = RawBrowser(server)
    page.tell()
    theirs = other.inputs()
    for each in raw.inputs():
        for name, value in (("update_cb", []), ("removed", True), ("label", "x"), ("max", 1e300)):
            updates = {"value": each.value, name: value}
            raw.say("GuiUpdateMessage", uuid=each._impl.uuid, updates=updates)
    for each in theirs:
        raw.set(each, "die")
    before = [each.value for each in theirs]
    raw.heard(server)
    for each in raw.inputs():
        assert not each._impl.removed
        assert getattr(each, "label", "") != "x"
    assert [each.value for each in theirs] == before
    page.tell()
    assert page.logged == []
    other.close()


def test_what_a_browser_leaves_behind_is_bounded(page, raw, server):
    search = next(each for each in raw.inputs() if getattr(each, "label", "") == "Search")
    raw.set(search, "die")
    raw.heard(server)
    page.tell()
    assert page.choice.search == "die"
    raw.set(search, "x" * 40_000_000)
    raw.heard(server)
    page.tell()
    assert page.choice.search == search.value == "die"
    pressed = next(each for each in raw.inputs() if getattr(each, "label", "") == "pressed")
    for i in range(50):
        raw.set(pressed, f"ignore:a{i} - b{i}#1")
        raw.set(pressed, f"pick:a{i} - b{i}#1")
    raw.heard(server)
    page.tell()
    assert page.choice.ignored == frozenset()
    assert page.choice.pair is None


def test_names_of_nothing_harm_nobody(page, raw, server, capfd):
    ray = {"ray_origin": [0, 0, 0], "ray_direction": [0, 0, 1], "modifier": None}
    for name in ("/nothing", "/parts/0/mesh", "/gizmo"):
        raw.say("TransformControlsUpdateMessage", **GIZMO | {"name": name})
        raw.say("TransformControlsDragStartMessage", name=name)
        raw.say("TransformControlsDragEndMessage", name=name)
        click = {"name": name, "instance_index": None, "screen_pos": [0, 0]}
        raw.say("SceneNodeClickMessage", **click | ray)
    raw.say("ScenePointerMessage", event_type="click", screen_pos=[[0, 0]], **ray)
    raw.say("CommandTriggerMessage", uuid="nobody")
    raw.heard(server)
    page.tell()
    assert page.logged == []
    assert not page.holds.poses
    assert "Traceback" not in capfd.readouterr().err


def encoded(kind, **fields):
    return msgspec.msgpack.encode({"type": kind} | fields)


GIZMO = {"name": "/gizmo", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0.0, 0.0, 0.0]}


@pytest.mark.parametrize(
    "sent, taken",
    [
        (encoded("ViewerCameraMessage", **CAMERA), True),
        (encoded("ViewerCameraMessage", **CAMERA | {"fov": float("nan")}), False),
        (encoded("ViewerCameraMessage", **CAMERA | {"position": [1.0, 2.0]}), False),
        (encoded("ViewerCameraMessage", **CAMERA | {"more": 1}), False),
        (encoded("TransformControlsUpdateMessage", **GIZMO), True),
        (encoded("TransformControlsUpdateMessage", **GIZMO | {"wxyz": [0, 0, 0, 0]}), False),
        (encoded("TransformControlsUpdateMessage", **GIZMO | {"wxyz": [1e-200, 0, 0, 0]}), False),
        (encoded("TransformControlsUpdateMessage", **GIZMO | {"position": [0, 0, 1e300]}), False),
        (encoded("GuiUpdateMessage", uuid="nobody", updates={"value": 1}), False),
        (encoded("RunJavascriptMessage", source="alert(1)"), False),
        (encoded("FileTransferStartUpload", source_component_uuid="x"), False),
        (encoded("no such message"), False),
        (b"", False),
        (b"\xc1", False),
        (b"\x91" * 15_000 + b"\x90", False),
        (msgspec.msgpack.encode(["a list"]), False),
        ("text", False),
    ],
)
def test_only_messages_of_the_page_s_own_kinds_are_read(sent, taken):
    assert Intake().takes(sent) is taken


@pytest.mark.parametrize("size", [TEXT + 1, BYTES + 1])
def test_a_text_that_is_too_long_is_put_back_where_it_was_typed(
    size, page, raw, server, monkeypatch
):
    search = next(each for each in raw.inputs() if getattr(each, "label", "") == "Search")
    raw.set(search, "die")
    raw.heard(server)
    told = []
    monkeypatch.setattr(search._impl.gui_api._websock_interface, "queue_message", told.append)
    raw.set(search, "x" * size)
    raw.heard(server)
    updates = [(each.uuid, each.updates) for each in told if hasattr(each, "updates")]
    assert updates == [(search._impl.uuid, {"value": "die"})]

"""Bodies that are point clouds, as a scene file declares them."""

import pytest

from proximity_monitor.scene.description import Cloud

FILE = """version: 1
unit: mm
bodies:
  - {name: hand, primitive: {sphere: {radius: 9}}, moving: true}
  - {name: scan, cloud: {topic: /front/points, radius: 5}}
  - {name: seen, cloud: {topic: points, frame: hand}}
"""


def test_a_cloud_has_a_topic_a_radius_in_the_scenes_unit_and_a_frame(load):
    hand, scan, seen = load(FILE).bodies
    assert scan.cloud == Cloud("/front/points", 0.005, "")
    assert seen.cloud == Cloud("points", 0.0, "hand")
    assert hand.posed
    assert not scan.posed
    assert scan.moving
    assert [(p.a, p.b) for p in load(FILE).pairs] == [
        ("hand", "scan"), ("hand", "seen"), ("scan", "seen"),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("radius: 5", "radius: -5", "5: bodies[1].cloud.radius: must be at least 0 (got -5)"),
        ("topic: points, ", "", "6: bodies[2].cloud: needs the key 'topic'"),
        (
            "frame: hand",
            "frame: scan",
            "6: bodies[2].cloud.frame: 'scan' is not a body with a pose",
        ),
        (
            "frame: hand",
            "frame: nose",
            "6: bodies[2].cloud.frame: 'nose' is not a body with a pose",
        ),
        ("radius: 5}", "radius: 5}, moving: true", "5: bodies[1]: needs exactly one of 'pose', "),
        (
            "radius: 5}",
            "radius: 5}, deforming: true",
            "5: bodies[1]: can have only one of 'cloud', ",
        ),
        (
            "radius: 5}",
            "radius: 5}, scale: 2",
            "5: bodies[1]: can have only one of 'cloud', 'scale'",
        ),
        ("radius: 5}", "radius: 5}, parts: false", "5: bodies[1]: can have only one of 'cloud', "),
        ("radius: 5}", "radius: 5}, moving_parts: [a]", "5: bodies[1]: can have only one of "),
        ("/front/points", "/front/", "5: bodies[1].cloud.topic: must be a topic name"),
    ],
)
def test_what_is_wrong_with_a_cloud_is_said(problems, old, new, problem):
    (told,) = problems(FILE.replace(old, new))
    assert told.startswith(problem)

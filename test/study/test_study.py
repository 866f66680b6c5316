"""The study runs, its numbers keep its promises, and it reports wrong arguments and data."""

from __future__ import annotations

import csv
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from proximity_monitor import engine
from proximity_monitor.study import __main__ as command_line
from proximity_monitor.study.accuracy import cones, degrees, iterations, paper, run, tolerance
from proximity_monitor.study.accuracy.certificate import BrokenCertificateError, check
from proximity_monitor.study.accuracy.data import read_rows
from proximity_monitor.study.accuracy.findings import findings
from proximity_monitor.study.accuracy.part import Job, only
from proximity_monitor.study.accuracy.run import PARTS
from proximity_monitor.study.accuracy.timing import Timed, blocks, take_turns
from proximity_monitor.study.surfaces import SURFACES

pytestmark = pytest.mark.long

DOCS = Path(__file__).resolve().parents[2] / "docs"
COMMAND = [sys.executable, "-m", "proximity_monitor.study", "accuracy"]
SMALL = ["--quick", "--part", "tolerance", "volumes", "--scene", "cave/path", "chain"]


def study(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*COMMAND, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )


def rows_of(out: Path, part: str) -> list[dict[str, str]]:
    with (out / "accuracy" / f"{part}.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def measured(tmp_path_factory) -> Path:
    """The folder that a small study wrote."""
    folder = tmp_path_factory.mktemp("study")
    done = study(*SMALL, "--out", "out", folder=folder)
    assert done.returncode == 0, done.stderr
    assert "accuracy.md" in done.stdout
    assert list(folder.iterdir()) == [folder / "out"]
    return folder / "out"


def test_errors_asked_for_are_respected(measured):
    rows = rows_of(measured, "tolerance")
    assert [float(row["rel_err"]) for row in rows] == list(tolerance.ASKED)
    for row in rows:
        assert int(row["queries"]) > 50
        assert float(row["error_max"]) <= float(row["rel_err"])
        assert float(row["bound_tests"]) <= float(rows[0]["bound_tests"])
    assert float(rows[-1]["error_max"]) > 0.01  # it does use the error allowed


def test_all_kinds_of_volume_answer_all_questions(measured):
    rows = rows_of(measured, "volumes")
    cases = [(question, volume) for question in paper.QUESTIONS for volume in paper.VOLUMES]
    assert [(row["question"], row["volume"]) for row in rows] == cases
    assert len({row["queries"] for row in rows}) == 1
    assert min(float(row["bound_tests"]) for row in rows) >= 1.0


def test_the_page_shows_every_figure_and_its_data(measured):
    page = (measured / "accuracy.md").read_text()
    images = re.findall(r"!\[[^]]+\]\(([^)]+)\)", page)
    assert images == [
        f"images/accuracy_{name}.png" for name in ("tolerance", "volumes_time", "volumes_tests")
    ]
    for image in images:
        assert (measured / image).read_bytes().startswith(b"\x89PNG")
    assert sorted((measured / "images").iterdir()) == sorted(measured / image for image in images)
    for link in re.findall(r"[^!]\[[^]]+\]\(([^)]+)\)", page):
        assert (measured / link).is_file()
    assert f"python -m proximity_monitor.study accuracy {' '.join(SMALL)} --out out" in page
    assert page.count("Not measured.") == len(run.PARTS) - 2
    assert not re.search(r"\b(nan|inf)\b|[{}]", page)


def test_the_page_leads_with_findings(measured):
    text = (measured / "accuracy.md").read_text(encoding="utf-8")
    lead = text.partition("## What to choose\n")[2].partition("\n## ")[0]
    assert [line[:5] for line in lead.splitlines() if line] == ["1. **", "2. **"]
    assert text.index("## What to choose") < text.index("## Time and error made")


def test_a_whole_study_comes_to_five_findings():
    data = {part.name: read_rows(DOCS / "accuracy" / f"{part.name}.csv") for part in PARTS}
    said = findings(data)
    assert said.count("**") == 10
    assert said in (DOCS / "accuracy.md").read_text(encoding="utf-8")


def test_the_page_is_made_of_the_data_alone(measured, tmp_path):
    out = tmp_path / "out"
    (out / "accuracy").mkdir(parents=True)
    for name in ("tolerance", "volumes", "runs"):
        text = (measured / "accuracy" / f"{name}.csv").read_text()
        (out / "accuracy" / f"{name}.csv").write_text(text)
    done = study("--render-only", "--out", str(out), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    for name in ("accuracy.md", "images/accuracy_tolerance.png"):
        assert (out / name).read_bytes() == (measured / name).read_bytes()


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["--scene", "nosuch"], ["--scene nosuch", "cave/path", "chain"]),
        (["--part", "growth", "--scene", "chain"], ["--scene chain", "growing"]),
        (["--part", "nosuch"], ["nosuch", "tolerance"]),
        (["--data", "."], ["--data", "falling_tori"]),
        (["--out", "file"], ["--out file"]),
    ],
)
def test_a_wrong_argument_is_refused_with_the_way_out(
    arguments, said, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    try:
        code = command_line.main(["accuracy", *arguments])
    except SystemExit as ended:  # argparse's own way
        code = ended.code
    assert code == 2
    refusal = capsys.readouterr().err
    for words in said:
        assert words in refusal
    assert not list(tmp_path.rglob("*.csv"))


def test_a_folder_that_cannot_be_written_is_told(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(run, "PARTS", (replace(cones.PART, measure=lambda job: [{"level": 1}]),))
    (tmp_path / "accuracy").write_text("not a folder")
    arguments = ["--quick", "--part", "cones", "--scene", "sheets/facing", "--out", str(tmp_path)]
    assert command_line.main(["accuracy", *arguments]) == 2
    assert f"--out {tmp_path}: " in capsys.readouterr().err


@pytest.mark.parametrize("text", [None, "2 0 0 x", "1 0 0"])
def test_recorded_data_that_does_not_read_is_told(text, tmp_path, capsys):
    (tmp_path / "falling_tori").mkdir()
    if text is not None:
        (tmp_path / "falling_tori" / "torus1.tris").write_text(text)
    out = tmp_path / "out"
    arguments = ["--part", "volumes", "--scene", "falling-tori", "--data", str(tmp_path)]
    assert command_line.main(["accuracy", *arguments, "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert re.search(r"--data or PROXIMITY_MONITOR_DATA: .*torus1\.tris: cannot be read", said)


def ended_by(error):
    """Return a part of one scene whose measuring raises `error`."""

    def measure(job):
        raise error

    return replace(cones.PART, measure=measure)


def test_an_interrupt_of_compiled_code_is_one_and_costs_no_data(tmp_path, capsys):
    data = tmp_path / "accuracy" / "cones.csv"
    data.parent.mkdir()
    data.write_text((DOCS / "accuracy" / "cones.csv").read_text())
    kept = data.read_text()
    makers = {"made": lambda: None}
    error = SystemError("a kernel returned a result with an exception set")
    with pytest.raises(SystemError):
        run.run([(ended_by(error), ["made"])], makers, tmp_path, True, "")
    error.__cause__ = KeyboardInterrupt()
    code = run.run([(ended_by(error), ["made"])], makers, tmp_path, True, "")
    assert code == run.INTERRUPTED
    assert "Interrupted" in capsys.readouterr().err
    assert data.read_text() == kept


def test_each_begins_its_turn_with_a_question_that_is_not_timed():
    asked = []

    def asker(name):
        return lambda steps: [partial(asked.append, (name, i)) for i in steps]

    found = take_turns({"a": asker("a"), "b": asker("b")}, [range(2), range(4, 6)], lambda n: None)
    assert [len(each.seconds) for each in found.values()] == [4, 4]
    first = [("a", 5), ("a", 0), ("a", 1), ("b", 5), ("b", 0), ("b", 1)]
    second = [("b", 1), ("b", 4), ("b", 5), ("a", 1), ("a", 4), ("a", 5)]
    assert asked == [("a", 5), ("b", 5), *first, *second]


def test_what_memory_saves_is_told_of_a_path_alone():
    rows = read_rows(DOCS / "accuracy" / "orders.csv")
    path, random = (only(rows, sequence=name) for name in ("verification", "computation"))
    said = findings({"orders": path})
    assert "(cave/path, exact)" in said
    assert findings({"orders": [*path, *random]}) == findings({"orders": [*random, *path]}) == said
    assert findings({"orders": random}) == ""


@pytest.mark.parametrize("more", [[], ["--data", "nosuch"]], ids=["", "no recorded data"])
def test_nothing_can_be_rendered_from_nothing(more, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert command_line.main(["accuracy", "--render-only", *more]) == 1
    assert "build/accuracy" in capsys.readouterr().err


def test_a_page_is_rendered_without_the_recorded_data(tmp_path, monkeypatch):
    monkeypatch.setattr("proximity_monitor.study.accuracy.page.render", lambda out, parts: out)
    (tmp_path / "accuracy").mkdir()
    (tmp_path / "accuracy" / "runs.csv").touch()
    arguments = ["accuracy", "--render-only", "--data", "nosuch", "--out", str(tmp_path)]
    assert command_line.main(arguments) == 0


def test_the_help_knows_every_part(capsys):
    assert [part.name for part in run.PARTS] == list(command_line.PARTS)
    with pytest.raises(SystemExit) as ended:
        command_line.main(["accuracy", "--help"])
    assert ended.value.code == 0
    said = capsys.readouterr().out
    for words in (*command_line.PARTS, "build/accuracy", "--render-only", "130"):
        assert words in said


@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGINT")
def test_an_interrupt_leaves_what_was_measured(tmp_path):
    first = tmp_path / "build" / "accuracy" / "accuracy" / "tolerance.csv"
    command = [*COMMAND, "--quick", "--part", "tolerance", "budget"]
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as running:
        deadline = time.monotonic() + 120.0
        while not first.is_file():
            assert running.poll() is None and time.monotonic() < deadline
            time.sleep(0.02)
        running.send_signal(signal.SIGINT)
        _, said = running.communicate(timeout=60.0)
    assert running.returncode == 130
    assert "Interrupted" in said
    page = (first.parents[1] / "accuracy.md").read_text()
    assert "images/accuracy_tolerance.png" in page
    assert "Not measured." in page


def answers(*pairs: engine.Pair, **settings: float) -> Timed:
    """Return the answers of pairs of points, the second model moved by two metres along x."""
    there = np.eye(4)
    there[0, 3] = 2.0
    found = [pair.distance(np.eye(4), there, **settings) for pair in pairs]
    return Timed([0.0] * len(found), found)


def test_a_broken_certificate_is_found():
    origin = engine.points([[0.0, 0.0, 0.0]])
    near = engine.points([[0.0, 0.0, 0.0], [-0.5, 0.0, 0.0]])
    true = answers(engine.Pair(origin, origin))
    check("the same", true, true, 0.0)
    other = answers(engine.Pair(origin, near))
    with pytest.raises(BrokenCertificateError, match="query 0"):
        check("another distance", other, true)
    with pytest.raises(BrokenCertificateError, match=r"error: 0\.1"):
        check("too far", true, other, 0.1)


def quickly(part, scene):
    """Return what a part measures on a scene of surfaces with few queries."""
    made = SURFACES[scene]()
    return part.measure(Job(scene, replace(made, block=8), True, lambda share: None))


def test_surfaces_of_all_degrees_are_asked_about():
    rows = quickly(degrees, "degrees/16")
    for question in (degrees.TO_POINT, degrees.TO_PATCH):
        mine = only(rows, question=question, net="16x16")
        assert [row["degree"] for row in mine] == list(range(2, 16))
        assert [row["pieces"] for row in mine] == [(16 - d) ** 2 for d in range(2, 16)]
        assert min(row["bound_tests"] for row in mine) >= 1.0


def test_iterations_lose_nothing_and_end_exact():
    rows = quickly(iterations, "nets/random")
    assert [row["iteration"] for row in rows] == list(range(1, len(rows) + 1))
    for key in ("gap_median", "error_max"):
        assert (np.diff([row[key] for row in rows]) <= 1e-9).all(), key
    for key in ("ended", "found", "bound_tests"):
        assert rows[0][key] < rows[-1][key], key
    assert rows[-1]["gap_median"] < 1e-9 < rows[0]["gap_median"]


@pytest.mark.parametrize(
    "lower, upper",
    [([0.0, 0.9, 0.8, 1.0], [2, 1, 1, 1]), ([0, 1.1, 1], [2, 2, 1]), ([0, 1], [0.9, 1])],
)
def test_bounds_that_an_iteration_loses_or_contradicts_are_found(lower, upper):
    course = iterations.Course(lower=lower, upper=upper)
    with pytest.raises(BrokenCertificateError, match="random: query 3"):
        iterations.check("random: query 3", course)
    iterations.check("good", iterations.Course(lower=[0, 0.9, 1], upper=[2, 1, 1]))


def test_blocks_are_spread_over_all_steps():
    assert blocks(10, 4, 99) == [range(4), range(4, 8), range(8, 10)]
    assert blocks(100, 10, 3) == [range(10), range(40, 50), range(90, 100)]
    assert blocks(5, 64, 2) == [range(5)]


def test_the_papers_cells_are_read_from_the_right_places():
    assert paper.volume_cost("collide", "Virtual Prototyping", "pss") == paper.Cost(
        4.92e6, 1.44e6, 173.92
    )
    assert paper.volume_cost("exact", "Path Planning", "rss") == paper.Cost(1.70e6, 0.196e6, 25.018)
    assert paper.volume_cost("10 %", "Dynamic Simulation", "hybrid") == paper.Cost(
        3.85e6, 0.179e6, 51.724
    )


def test_cones_prune_no_pair_that_holds_the_nearest_points():
    """The nearest points of two domes are at a corner of four patches each: 16 pairs hold them."""
    rows = quickly(cones, "sheets/facing")
    for method in cones.METHODS:
        mine = only(rows, method=method)
        assert [row["level"] for row in mine] == [0, 1, 2]
        for row in mine:
            assert row["pairs"] * (1.0 - row["pruned"]) >= 15.9
    told = {m: only(rows, method=m, level=2)[0]["pairs"] for m in cones.METHODS}
    assert told["directions and cones"] <= told["directions"] < told["spheres"]
    assert told["spheres and cones"] < told["spheres"]
    # Two parallel squares 1 apart are kept at a distance of 1, and pruned at a distance of 0.9.
    flat = np.stack(np.meshgrid(*2 * [np.linspace(0.0, 1.0, 4)], indexing="ij"), axis=-1)
    nets = np.stack([np.dstack((flat, np.full((4, 4), height))) for height in (0.0, 1.0)])
    cells, pairs = cones.Cells(nets), np.array([[0, 1]])
    assert not cones.pruned(cells, cells, pairs, "spheres and cones", 1.0).any()
    assert cones.pruned(cells, cells, pairs, "directions", 0.9).all()

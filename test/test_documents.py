"""The documents are right: links lead somewhere, programs run, generated pages are current."""

import ast
import importlib
import importlib.util
import json
import re
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from proximity_monitor import engine
from proximity_monitor.scene.paths import bundled_names

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]
EXAMPLES = ROOT / "examples"

FENCED = re.compile(r"^```(.*?)^```", re.M | re.S)
LINK = re.compile(r"\]\(([^)\s]+)\)")


def prose(page):
    """Return a page without its programs."""
    return FENCED.sub("", page.read_text(encoding="utf-8"))


def blocks(page, language):
    """Return the programs of a page in a language, such as "python"."""
    found = FENCED.findall(page.read_text(encoding="utf-8"))
    return [text.partition("\n")[2] for text in found if text.split("\n")[0].strip() == language]


def anchors(page):
    """Return the anchors of a page's headings, as GitHub and mkdocs make them."""
    headings = re.findall(r"^#+ (.+)$", prose(page), re.M)
    plain = [re.sub(r"[^\w\s-]", "", heading.lower()).strip() for heading in headings]
    return [re.sub(r"\s", "-", heading) for heading in plain]


def tool(name):
    """Import a program of the folder `tools`, and return it as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "tools" / f"{name}.py")
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def rows(page, heading):
    """Return the cells of the first table under a heading, without the table's title row."""
    text = f"\n{page.read_text(encoding='utf-8')}".partition(f"\n{heading}\n")[2]
    lines = re.search(r"(?:^\|.*\n)+", text, re.M)[0].splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_and_anchors_lead_somewhere(page):
    assert len(set(anchors(page))) == len(anchors(page)), "two headings have one anchor"
    for link in LINK.findall(prose(page)):
        if link.startswith(("https://", "http://")):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f"{link} leads nowhere"
        inside = target.is_relative_to(DOCS)
        assert inside or not page.is_relative_to(DOCS), f"{link}: the site has only docs/"
        if anchor:
            assert anchor in anchors(target), f"{link}: no such heading"


def test_files_and_targets_that_pages_name_exist():
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.M)
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for name in re.findall(r"\b(?:tools|examples|benchmark|test)/[\w/]+\.py\b", text):
            assert (ROOT / name).is_file(), f"{page.name}: {name}"
        for name in re.findall(r"(?:`|^)make ([a-z]+)", text, re.M):
            assert name in targets, f"{page.name}: make {name}"


def test_commands_that_pages_show_exist():
    extras = set(re.findall(r'^        "(\w+)":', (ROOT / "setup.py").read_text(), re.M))
    started = {"run": ROOT / "scripts", "launch": ROOT / "launch"}
    found = set()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for kind, name in re.findall(r"ros2 (run|launch) proximity_monitor ([\w.]+)", text):
            found.add(name)
            assert (started[kind] / name).is_file(), f"{page.name}: ros2 {kind} {name}"
        for names in re.findall(r"pip install '?(?:\.|proximity_monitor)\[([\w,]+)\]", text):
            assert set(names.split(",")) <= extras, f"{page.name}: {names}"
        for command in re.findall(r"`proximity_monitor (\w+)", text):
            assert command in ("demo", "display", "scene"), f"{page.name}: {command}"
    assert found == {"node", "player", "display", "demo.launch.py"}


def test_every_picture_is_shown_somewhere():
    shown = {name for page in PAGES for name in re.findall(r"images/([\w.]+)\)", prose(page))}
    assert shown == {file.name for file in (DOCS / "images").iterdir()}


def test_the_readme_is_short():
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 95
    assert "make test" in "\n".join(lines)


def test_figures_of_the_readme_are_those_of_the_page_on_speed():
    """The readme has a selection of the page's figures; `make bench` makes both."""
    found = {row[1]: row for row in rows(DOCS / "speed.md", "# How fast")}
    chosen = rows(ROOT / "README.md", "## How fast")
    assert len(chosen) == 4
    for row in chosen[:3]:
        assert row[1:] == found[row[1]][1:4]
    text = (DOCS / "speed.md").read_text(encoding="utf-8")
    means = re.search(r"([\d.]+) times FCL and ([\d.]+) times coal", text).groups()
    assert chosen[3][2:] == [f"{float(mean):.0f}" for mean in means]


def test_the_keys_of_a_scene_file_are_the_schema_s():
    """If this fails, run `python tools/write_scene_keys.py`."""
    writer = tool("write_scene_keys")
    schema = json.loads(writer.SCHEMA.read_text(encoding="utf-8"))
    page = writer.page(schema)
    assert writer.PAGE.read_text(encoding="utf-8") == page

    def keys(part):
        if isinstance(part, dict):
            yield from part.get("properties", {})
        for each in part.values() if isinstance(part, dict) else part:
            if isinstance(each, dict | list):
                yield from keys(each)

    missing = {key for key in keys(schema) if f"| `{key}` |" not in page}
    assert not missing


def test_all_bundled_scenes_are_listed():
    listed = [row[0].strip("`") for row in rows(DOCS / "scenes.md", "## Bundled scenes")]
    assert sorted(listed) == bundled_names()


def test_the_glossary_has_ten_words():
    words = rows(DOCS / "glossary.md", "# Glossary")
    assert len(words) == 10


def test_the_reference_has_every_public_name():
    pages = sorted((DOCS / "api").glob("*.md"))
    named = [
        name for page in pages for name in re.findall(r"^::: ([\w.]+)$", page.read_text(), re.M)
    ]
    assert len(set(named)) == len(named)
    for name in named:
        module, _, last = name.rpartition(".")
        try:
            found = importlib.import_module(name)
        except ModuleNotFoundError:
            found = getattr(importlib.import_module(module), last)
        assert found.__doc__, name
    last = {name.rpartition(".")[2] for name in named} | {"points", "polyline"}  # of `shapes`
    assert set(engine.__all__) <= last


def test_the_programs_of_the_documents_run(tmp_path, monkeypatch, capsys):
    """The readme's program runs in an empty folder, the library's beside the STL file it names."""
    monkeypatch.chdir(tmp_path)
    for page in (ROOT / "README.md", DOCS / "library.md"):
        (program,) = blocks(page, "python")
        capsys.readouterr()
        exec(program, {})
        assert capsys.readouterr().out.startswith("Status.")
        two_parts = runpy.run_path(str(EXAMPLES / "two_parts.py"))
        two_parts["write_stl"](tmp_path / "bracket.stl", two_parts["pin"](10.0, 30.0))


def test_all_programs_are_listed_and_say_how_they_are_started():
    listed = [row[0].strip("`") for row in rows(DOCS / "library.md", "## Examples")]
    assert sorted(listed) == sorted(file.name for file in EXAMPLES.glob("*.py"))
    for name in listed:
        text = ast.get_docstring(ast.parse((EXAMPLES / name).read_text(encoding="utf-8")))
        assert f"python {name}" in text


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run an example in an empty folder, and return what it prints, line by line."""
    monkeypatch.chdir(tmp_path)

    def run(name, *arguments):
        monkeypatch.setattr(sys, "argv", [name, *arguments])
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        return capsys.readouterr().out.splitlines()

    return run


def test_example_of_two_parts(run):
    assert run("two_parts.py") == ["ring.stl: 512 triangles", "pin.stl: 384 triangles"]
    assert all(engine.load(name, unit=0.001).is_solid for name in ("ring.stl", "pin.stl"))
    *shown, _ = run("clearance.py", "ring.stl", "pin.stl")
    bounds = np.array([re.findall(r"\d+\.\d{6}", line) for line in shown], float)
    assert (bounds[:, 0] <= bounds[:, 1]).all()
    # On the axis, the gap between two prisms of 64 sides is smaller than between circles.
    assert bounds[-1] == pytest.approx(0.05 * np.cos(np.pi / 64), abs=1e-6)


def test_example_of_a_budget(run):
    *calls, tolerant = run("budget.py")
    bounds = np.array([re.findall(r"\d\.\d{6}", line) for line in calls], float)
    assert (np.diff(bounds[:, 0]) >= 0.0).all() and (np.diff(bounds[:, 1]) <= 0.0).all()
    assert calls[0].endswith("out of time") and calls[-1].endswith("exact")
    assert tolerant == "within 10 %: within tolerance"


def test_example_of_many_pairs(run):
    assert [int(line.split()[2]) for line in run("many_pairs.py")] == [0, 0, 0, 9]


def test_example_of_curved_parts(run):
    first, vase, sheet, last = run("curved.py")
    lower, upper = map(float, re.findall(r"\d+\.\d{9}", first))
    assert 0.0 <= upper - lower < 1e-6
    assert vase.startswith("  on the vase: profile") and sheet.startswith("  on the sheet: patch 0")
    assert last.startswith("after a change of 20.0 mm: ")
    # The vase grew by 20 mm below the sheet. The sheet slopes, so the clearance shrank by less.
    assert upper - 20.0 <= float(last.split()[-2]) < upper


def test_example_of_all_kinds(run):
    title, *lines = run("kinds.py")
    kinds = title.split()
    assert [line.split()[0] for line in lines] == kinds
    assert len(kinds) == 7
    matrix = np.array([line.split()[1:] for line in lines], float)
    assert (matrix > 0.0).all()
    # The points are the polyline's corners.
    polyline, points = kinds.index("polyline"), kinds.index("points")
    assert (matrix[polyline] <= matrix[points]).all()


def test_example_of_a_scene_without_ros(run):
    """The comments in the bundled scene of the peg say which states are to be seen."""
    lines = run("watch_a_scene.py")
    assert lines[0].startswith(" 0.0 s  peg - block: clear")
    assert [line.split()[5] for line in lines] == ["clear:", "warn:", "clear:", "warn:", "clear:"]

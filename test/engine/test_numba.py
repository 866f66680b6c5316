"""What the engine assumes of numba beyond its documentation, one assumption per test.

All such code is in kernels/base. If a new numba breaks the engine, the tests that fail here name
the broken assumption. The newest numba known to work is given below.
"""

from __future__ import annotations

import ast
from collections import namedtuple
from pathlib import Path

import numba
import numpy as np
import pytest
from engine_bodies import torus
from llvmlite.binding import get_host_cpu_features
from numba import float64, int64
from numba.core import event
from numba.core.caching import NullCache

from proximity_monitor import engine
from proximity_monitor.engine.kernels.base import cache, jit, lanes, lazy, memory, tables
from proximity_monitor.engine.kernels.base.state import FAR, PROGRESS, Priority, State, Waiting
from proximity_monitor.engine.kernels.base.trees import MeshTree
from proximity_monitor.engine.kernels.bounds import volumes
from proximity_monitor.engine.kernels.inside.ball_state import (
    CELL,
    OF_CELLS,
    POINT,
    SEARCH,
    Ball,
    ball_at,
    ball_table,
)
from proximity_monitor.engine.kernels.inside.solid_table import solid_at
from proximity_monitor.engine.kernels.inside.solids import HALF
from proximity_monitor.engine.kernels.tree.layout import STRIDE, WIDTH
from proximity_monitor.engine.questions.run import Search

KNOWN = "0.68"
BASE = Path(engine.__file__).parent / "kernels" / "base"

Own = namedtuple("Own", "x")
Other = namedtuple("Other", "x")
RECORD = np.dtype([("count", np.int64), ("vector", np.float64, (3,))], align=True)


def run(kernel):
    """Compile a kernel that Python calls, as an entry is compiled, but without a cache."""
    compiled = jit.entry(kernel)
    compiled._cache = NullCache()
    return compiled


def broken(what: str) -> str:
    return f"numba {numba.__version__} (known to work: {KNOWN}) no longer {what}"


def address(array: np.ndarray) -> int:
    return array.__array_interface__["data"][0]


def test_arrays_stand_at_addresses():
    @run
    def total(at, rows):
        table = memory.read_only(memory.rows_at(at, rows, 3, 0.0))
        return table[rows - 1, 2] + table.shape[0]

    table = np.arange(6.0).reshape(2, 3)
    assert total(address(table), 2) == 7.0, broken("makes arrays of addresses (memory.rows_at)")


@pytest.mark.skipif(
    not get_host_cpu_features().get("avx512vbmi2"), reason="no processor for vectors as wide"
)
def test_vectors_are_as_wide_as_registers():
    @run
    def bound(nodes, single, bounds):
        volumes.lower_bounds(nodes, np.uint64(0), single, bounds, np.uint64(0))

    bound(*(np.ones(size, np.float32) for size in (STRIDE, 15, WIDTH)))
    (compiled,) = bound.overloads.values()
    assert "zmm" in compiled.library.get_asm_str(), broken("hands on a function's attributes")


def test_records_stand_at_addresses():
    @run
    def count(at):
        record = memory.records_at(at, 1, RECORD)[0]
        record.count += 2
        record.vector[1] = 5.0
        return record.count

    made = np.zeros(1, RECORD)
    made["count"] = 40
    what = broken("makes records of addresses, or lays them out as numpy (memory.records_at)")
    assert count(address(made)) == 42, what
    assert made["count"][0] == 42, what
    assert made["vector"][0].tolist() == [0.0, 5.0, 0.0], what


def test_arrays_lie_on_the_stack():
    @run
    def sums():
        row, table = memory.on_stack(4, np.float32(0.0)), memory.table_on_stack(2, 3, 0)
        for i in range(4):
            row[i] = i
        table[1, 2] = 7
        return row[3] + table[1, 2], table.shape[0] * table.shape[1]

    assert sums() == (10.0, 6), broken("has arrays on the stack (memory.on_stack)")


def test_kernels_do_without_reference_counts():
    @run
    def first(rows):
        return rows[0]

    first(np.zeros(1))
    (code,) = first.inspect_llvm().values()
    assert "NRT_incref" not in code, broken("compiles without reference counts (_nrt=False)")


def test_helpers_are_linked_where_they_are_called():
    """Helpers become machine code only where they are called: see linking.py."""

    @jit.kernel
    def below(x):
        return x + 1

    @jit.kernel
    def helper(x):
        return below(x) * below(x + 2)

    @jit.shared
    def shared(x):
        return helper(x) + below(x)

    shared._cache = NullCache()

    @run
    def kept(x):
        return shared(x) + below(x) - helper(2 * x)

    assert kept(3) == (24 + 4) + 4 - 63, broken("links functions by their libraries (linking.py)")
    for each in (below, helper):
        (compiled,) = each.overloads.values()
        assert not compiled.codegen._engine.is_symbol_defined(compiled.fndesc.mangled_name), broken(
            "lets a library do without machine code (linking.py)"
        )


def test_kernels_take_no_options_from_their_callers():
    """Otherwise sums below a `loop16` would be reordered, depending on the order of questions."""

    @jit.kernel
    def below(x, y):
        return (x + y) - x

    for made in (jit.loop16, jit.inlined, jit.fused, jit.inlined16):
        helper = jit.kernel(below.py_func)

        @made
        def caller(x, y, helper=helper):
            return helper(x, y) + (x + y)

        assert run(lambda x, y, caller=caller: caller(x, y))(1.0, 2.0) == 5.0
        (compiled,) = helper.overloads.values()
        code = str(compiled.library._final_module)
        assert " fadd double" in code and " fsub double" in code
        assert "alwaysinline" not in code, broken("lets a kernel say its own options (jit._OWN)")


def test_one_kernel_takes_all_integers():
    @jit.kernel
    def helper(i, flag):
        return i + 1 if flag else i

    @run
    def sums(i, small):
        return helper(i, True) + helper(2, False) + helper(3, i > 0) + helper(small[0], True)

    what = broken("asks a kernel for its template (sooner.widened)")
    assert sums(1, np.array([4], np.int32)) == 2 + 2 + 4 + 5, what
    assert len(helper.overloads) == 1, what


def test_lanes_become_masks():
    @run
    def masks(values):
        below = lanes.not_above(values, 0, np.float32(3.0))
        return (
            below,
            lanes.lowest(below),
            lanes.smallest(values, 0, below),
            lanes.fma(2.0, 3.0, 4.0),
        )

    values = np.full(16, 9.0, np.float32)
    values[[3, 5]] = 2.0, 1.0
    found = masks(values)
    assert found == ((1 << 3) | (1 << 5), 3, 1.0, 10.0), broken("takes our LLVM code (lanes.py)")


def test_axes_are_turned_as_by_single_products():
    @run
    def turn(nodes, back, out):
        lanes.turn_axes(nodes, np.int64(5), back, out)

    rng = np.random.default_rng(3)
    nodes, back = rng.normal(size=192).astype(np.float32), rng.normal(size=12)
    out = np.full(16, -7.0, np.float32)
    turn(nodes, back, out)
    columns = back[:9].reshape(3, 3)
    u, v = (
        columns[0] * float(nodes[5 + 16 * k])
        + columns[1] * float(nodes[21 + 16 * k])
        + columns[2] * float(nodes[37 + 16 * k])
        for k in (3, 6)
    )
    w = u[[1, 2, 0]] * v[[2, 0, 1]] - u[[2, 0, 1]] * v[[1, 2, 0]]
    what = broken("takes our LLVM code (lanes.py)")
    expected = [*u, *v, *w]
    assert (out[[3, 4, 5, 6, 7, 8, 11, 12, 13]] == np.array(expected, np.float32)).all(), what
    assert (out[[0, 1, 2, 15]] == -7.0).all(), what


def kind_of(thing):
    """A stub, implemented for two types below."""


@jit.implements(kind_of, Own)
@jit.kernel
def _own(thing):
    return 1


@jit.implements(kind_of, (Other,))
@jit.kernel
def _other(thing):
    return 2


def test_a_type_chooses_the_kernel():
    @run
    def chosen():
        return kind_of(Own(1.0)), kind_of(Other(1.0)), kind_of(Own), kind_of(Other)

    what = "lets a kernel stand in for a stub by the type of a NamedTuple (jit.implements)"
    assert chosen() == (1, 2, 1, 2), broken(what)


CONSTANT = 1


def _constant():
    return CONSTANT


def test_globals_are_constants():
    found = [run(jit.specialised(_constant, f"constant_{i}", CONSTANT=i))() for i in (2, 3)]
    assert found == [2, 3], broken("takes globals for constants (jit.specialised)")


def test_a_kernel_is_kept_and_found_again(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "DIRECTORIES", [tmp_path])
    monkeypatch.setattr(cache, "CACHE_DIRECTORY", tmp_path)
    compiled = []

    class Listener(event.Listener):
        def on_start(self, start):
            compiled.append(start.data["dispatcher"].py_func.__name__)

        def on_end(self, end):
            pass

    with event.install_listener("numba:compile", Listener()):
        for _ in range(2):
            assert jit.entry(_constant)() == 1
    assert len(list(tmp_path.glob("*.nbc"))) == 1, broken("gives compiled code to keep (cache.py)")
    assert compiled == ["_constant"], broken("takes kept code, or reports compiling (cache.py)")


def test_tables_lead_to_the_arrays_that_they_were_made_of():
    """The kernels fix offsets and types by hand, so check that they read the values put there."""

    @run
    def read(model, memory_of_search):
        tree, faces = tables.tree_at(MeshTree, model)
        search = tables.state_at(Priority, Waiting, memory_of_search)
        progress = search.progress[0]
        progress.distance, progress.nearest_b = 1.0, 2
        search.motions[1, 11], search.collected[2, 2] = 3.0, 4.0
        search.waiting.lanes[1, 1], search.waiting.bounds[1] = 5, 6.0
        search.open.pairs[3, 1], search.open.bounds[3], search.open.frames[1] = 7, 8.0, 9
        far = search.far[3]
        far.key, far.reach, far.kept, far.least = 10, 11.0, 12, 13.0
        return (tree.nodes[-1], tree.centres[-1, 3], tree.children[-1], tree.sizes[-1, 1],
                tree.triangles[-1, 8], tree.scale[-1], faces[-1])  # fmt: skip

    hierarchy = torus(16)._hierarchy
    arrays = *hierarchy.tree, hierarchy.numbers
    state = State(
        np.zeros((2, 12)), np.zeros(1, PROGRESS),
        Priority(np.zeros((4, 2), np.int32), np.zeros(4), np.zeros(2, np.int64)),
        Waiting(np.zeros((2, 2), np.int32), np.zeros(2)), np.zeros((3, 3)),
        np.zeros(4, FAR),
    )  # fmt: skip
    found = read(tables.model_table(hierarchy.numbers, hierarchy.tree), tables.state_table(state))
    assert found == tuple(each.flat[-1] for each in arrays)
    assert (state.progress["distance"][0], state.progress["nearest_b"][0]) == (1.0, 2)
    assert (state.motions[1, 11], state.collected[2, 2]) == (3.0, 4.0)
    assert (state.waiting.lanes[1, 1], state.waiting.bounds[1]) == (5, 6.0)
    assert [each.flat[-1] for each in state.open] == [7, 8.0, 9]
    assert state.far[3].tolist() == (10, 11.0, 12, 13.0)
    for k, name in enumerate(hierarchy.tree._fields):
        other = hierarchy.tree._replace(**{name: np.zeros(arrays[k].shape, np.int8)})
        with pytest.raises(TypeError, match=f"{name}: int8"):
            tables.model_table(hierarchy.numbers, other)


def test_tables_of_solids_and_of_balls_lead_to_their_arrays():
    @run
    def read(solid, memory):
        tree, faces, region = solid_at(MeshTree, solid)
        ball = ball_at(OF_CELLS, memory)
        ball.at[0].height, ball.motions[1, 11], ball.seeds[2, 2] = 1, 2.0, 3.0
        ball.best[0].near[1], ball.trial[0].near[1], ball.probe[0].near[1] = 4, 5, 6
        ball.bounds[1], ball.order[1], ball.cells[1].near[1] = 7.0, 8, 9
        ball.stack[1], ball.reached[1] = 10, 11.0
        return (tree.triangles[-1, 8], faces[-1], region.inside, region.samples[-1],
                region.ball[3], region.rim, region.rim_tree.triangles[-1, 8],
                region.moments[-1, -1])  # fmt: skip

    points = np.zeros(3, POINT)
    ball = Ball(
        np.zeros(1, SEARCH), np.zeros((2, 12)), np.zeros((3, 3)), points[:1], points[1:2],
        points[2:], np.zeros(2), np.zeros(2, np.int32), np.zeros(2, CELL), np.zeros(2, np.int32),
        np.zeros(2),
    )  # fmt: skip
    mesh = torus(16)
    open_mesh = engine.TriangleMesh(mesh.vertices, mesh.faces[:-1], solid="robust")
    sides, hierarchy = open_mesh._hierarchy.sides(), open_mesh._hierarchy
    region = sides.region
    found = read(sides.table, ball_table(ball, ()))
    assert found == (
        hierarchy.tree.triangles[-1, 8], hierarchy.numbers[-1], region.inside, region.samples[-1],
        region.ball[3], region.rim, region.rim_tree.triangles[-1, 8], region.moments[-1, -1],
    )  # fmt: skip
    assert region.inside == HALF
    assert region.rim > 0.0
    assert (ball.at["height"][0], ball.motions[1, 11], ball.seeds[2, 2]) == (1, 2.0, 3.0)
    assert points["near"][:, 1].tolist() == [4, 5, 6]
    assert (ball.bounds[1], ball.order[1], ball.cells["near"][1, 1]) == (7.0, 8, 9)
    assert (ball.stack[1], ball.reached[1]) == (10, 11.0)


@pytest.mark.long
def test_only_the_base_is_clever():
    """Only kernels/base and compiling.py use LLVM and what numba does not document."""
    found = []
    for file in sorted(BASE.parents[1].rglob("*.py")):
        if file.parent == BASE or file.name == "compiling.py":
            continue
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [alias.name for alias in getattr(node, "names", [])]
            module = getattr(node, "module", None) or ""
            used = [module, *names] if isinstance(node, ast.Import | ast.ImportFrom) else []
            if any(each.startswith(("numba.", "llvmlite")) for each in used):
                found.append(f"{file.name}:{node.lineno}")
    assert found == []


def test_code_is_called_by_its_address_and_compiled_at_the_first_call():
    @lazy.lazy((MeshTree,), (MeshTree,), Waiting, int64, float64, nothing=(7, 8))
    def part(tree_a, tree_b, state, count, share):
        return len(tree_a.triangles) + count, int64(4.0 * share)

    @run
    def whole(model, memory):
        tree, _ = tables.tree_at(MeshTree, model)
        return part(tree, tree, tables.state_at(Priority, Waiting, memory), 3, 0.5)

    own = part.parts[Priority, MeshTree, MeshTree]
    own.kernel._cache = NullCache()
    mesh = torus(16)
    model, memory = mesh._hierarchy.table, Search(mesh, mesh).memory
    count = len(mesh.faces)
    assert not own.kernel.overloads
    what = broken("calls code by an address (lazy.Part.call)")
    assert [whole(model, memory) for _ in range(2)] == 2 * [(count + 3, 2)], what
    assert len(own.kernel.overloads) == 1

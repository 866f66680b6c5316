"""Changes to numba that make it compile sooner. Each test shows what one change relies on."""

import ast
import gc
import math
import operator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from llvmlite import ir
from numba.core import compiler, errors, event
from numba.core import ir as numba_ir
from numba.core.caching import NullCache
from numba.core.compiler import DefaultPassBuilder
from test_numba import broken, run

from proximity_monitor.engine.kernels.base import jit, linking, sooner

_THIRD = 1.0 / 3.0


def test_options_are_read_as_numba_reads_them():
    flags = compiler.Flags()
    flags.fastmath = {"contract"}
    flags.error_model = "numpy"
    read = {name: getattr(flags, name) for name in flags.options}
    assert flags.values() == read, broken("keeps options in _values (sooner._values)")
    assert flags == flags.copy() and flags != compiler.Flags()
    assert hash(flags) == hash(flags.copy())


def test_a_function_is_not_first_asked_whether_it_is_data(monkeypatch):
    asked, data_type = [], sooner._data_type

    def count(context, value):
        asked.append(value)
        return data_type(context, value)

    monkeypatch.setattr(sooner, "_data_type", count)
    root = numba.njit(lambda x: math.sqrt(x) + _THIRD)
    assert root(4.0) == 2.0 + _THIRD
    what = broken("asks for a constant's type by resolve_value_type (sooner._resolve_value_type)")
    assert _THIRD in asked, what
    assert math not in asked and operator.add not in asked, what
    with pytest.raises(numba.TypingError, match="Untyped global name 'broken'"):
        numba.njit(lambda: broken("none of numba's functions"))()


def test_an_error_is_told_with_its_context():
    """As numba's own context does, which `sooner` replaces where most contexts are entered."""
    with pytest.raises(numba.TypingError) as raised:
        numba.njit(lambda x: x.none)(1.0)
    assert "typing of get attribute at" in str(raised.value)
    replaced = [numba.core.typeinfer, numba.core.lowering]
    what = broken("adds context to errors by new_error_context (sooner._ErrorContext)")
    assert all(each.new_error_context is sooner._ErrorContext for each in replaced), what
    with (
        pytest.raises(errors.TypingError) as raised,
        sooner._ErrorContext("at {place}", place="here"),
    ):
        raise errors.TypingError("it")
    assert "During: at here" in str(raised.value)


def test_passes_that_change_nothing_in_a_kernel_are_left_out():
    state = SimpleNamespace(func_ir=None, flags=compiler.Flags())
    known = {each for each, _ in DefaultPassBuilder.define_nopython_pipeline(state).passes}
    assert known >= linking.NEEDLESS, broken("has these passes (linking.NEEDLESS)")
    made = run(_branching)
    with event.install_recorder("numba:run_pass") as recorder:
        assert made(3, 2.0) == 12.0
    about = [each.data for _, each in recorder.buffer if each.data["qualname"] == "_branching"]
    names = {each["name"].partition(" [")[0] for each in about}
    assert "native_lowering" in names and not names & {each._name for each in linking.NEEDLESS}


def test_what_an_operator_does_is_looked_up_once(monkeypatch):
    known, looked_up = sooner._look_up, []

    def look_up(function, context, args, kws):
        looked_up.append((function.typing_key, args))
        return known(function, context, args, kws)

    monkeypatch.setattr(sooner, "_look_up", look_up)
    for _ in range(2):
        at = numba.njit(lambda values, i: values[i] * 2.0)
        assert at(np.array([1.0, 3.0]), 1) == 6.0
        assert numba.njit(lambda x: 2.0 * x)(3) == 6.0, "the types decide"
    what = broken("asks a function for a call's signature (sooner._get_call_type)")
    products = [args for key, args in looked_up if key is operator.mul]
    assert len(products) == len(set(products)), what
    with pytest.raises(numba.TypingError):
        numba.njit(lambda x, values: x << values)(1.5, np.ones(2))


def test_what_numba_compiles_for_an_operator_has_its_caller_s_options():
    codes = []
    for fast in (True, False):
        largest = numba.njit(lambda x, y: max(x, y), fastmath=fast)
        assert largest(np.float32(1.0), 2.0) == 2.0
        codes += largest.inspect_llvm().values()
    assert [" fast " in code for code in codes] == [True, False]


def test_what_lives_in_each_block_is_left_out(monkeypatch):
    asked = []
    everything = sooner._post_process

    def count(self, *options):
        asked.append(self.func_ir.func_id.func_qualname)
        everything(self, *options)

    monkeypatch.setattr(sooner, "_post_process", count)
    assert run(_branching)(3, 2.0) == 12.0
    kernel = run(_branching)
    monkeypatch.setattr(sooner, "_KERNELS", __name__)
    asked.clear()
    what = broken("prepares code for its passes by PostProcessor.run (sooner._run)")
    assert kernel(3, 2.0) == 12.0
    assert "_branching" not in asked, what
    numba.njit(_yielding)
    assert list(numba.njit(_yielding)(3)) == [0.0, 1.0, 2.0]
    assert "_yielding" in asked, what


def test_where_variables_end_is_said_only_to_count_references(monkeypatch):
    monkeypatch.setattr(sooner, "_KERNELS", __name__)
    inserted, insert = [], sooner.PostProcessor._insert_var_dels

    def count(self, **options):
        inserted.append(self.func_ir.func_id.func_qualname)
        insert(self, **options)

    monkeypatch.setattr(sooner.PostProcessor, "_insert_var_dels", count)
    assert run(_branching)(3, 2.0) == 12.0
    assert run(_late)(3) == 3.0
    what = broken("tells a function's own options (sooner.widened)")
    assert not {"_branching", "_late"} & set(inserted), what
    made = jit.allocating_entry(_made)
    made._cache = NullCache()
    assert [made(2).tolist() for _ in range(2)] == 2 * [[0.0, 1.0]]
    assert "_made" in inserted, "else no array would ever be given back"


def _made(count):
    for i in range(count):
        row = np.arange(1.0 + i)
    return row


def _late(count):
    for i in range(count):
        if i == 0:
            last = 1.0
        else:
            last += 1.0
    return last


def test_how_large_a_type_is_is_found_once(monkeypatch):
    measured, measure = [], sooner._measure

    def count(context, kind):
        measured.append(str(kind))
        return 8 * len(kind.elements) if "%" in str(kind) else measure(context, kind)

    monkeypatch.setattr(sooner, "_measure", count)
    context = run(_branching).targetctx
    real, odd = ir.DoubleType(), ir.IntType(56)
    for _ in range(3):
        pair = ir.LiteralStructType([odd, real, ir.ArrayType(odd, 3)])
        assert context.get_abi_sizeof(pair) == 40
        assert context.get_abi_sizeof(ir.LiteralStructType([odd, odd], packed=True)) == 16
    named = ir.Context().get_identified_type("a name")
    for elements in ([real], [real, real]):
        named.elements = None
        named.set_body(*elements)
        assert context.get_abi_sizeof(named) == 8 * len(elements), "its text is its name"
    assert measured.count(str(pair)) == 1, broken("measures a type by the context")


def _branching(count, x):
    total = 0.0
    for i in range(count):
        if i > 0:
            total += x * i
        else:
            total += 3.0 * x
    return total


def _yielding(count):
    x = 0.0
    for _ in range(count):
        yield x
        x += 1.0


def test_what_may_be_written_out_is_known_without_an_error(monkeypatch):
    raised = []
    monkeypatch.setattr(errors, "LiteralTypingError", raised.append)
    kernel = run(_branching)
    assert kernel(3, 2.0) == 12.0
    what = broken("asks types.maybe_literal and lowering._lit_or_omitted (sooner._literal)")
    assert not raised, what
    for value in (1, 1.5, "name", True, None, slice(1, 2)):
        with suppress(errors.TypingError):
            assert numba.types.maybe_literal(value) == numba.types.literal(value), what


def test_the_variables_of_an_instruction_are_those_that_numba_finds(monkeypatch):
    code = numba.core.compiler.run_frontend(_with_all_kinds)
    found = [each for block in code.blocks.values() for each in block.body]
    own = [[variable.name for variable in each.list_vars()] for each in found]
    assert any(len(each) > 3 for each in own) and any(not each for each in own)
    what = broken("finds variables by Inst._rec_list_vars (sooner._variables)")
    monkeypatch.setattr(numba_ir.Inst, "_rec_list_vars", _variables)
    assert own == [[variable.name for variable in each.list_vars()] for each in found], what


def _with_all_kinds(values, n):
    pair = (values, n)
    table = {"n": n, "m": n}
    for i in range(n):
        values[i] = max(pair[0][i], n, key=len(table))
    return f"{n} {pair}"


def _variables(self, held):
    if isinstance(held, numba_ir.Var):
        return [held]
    if isinstance(held, numba_ir.Inst):
        return held.list_vars()
    parts = held.values() if isinstance(held, dict) else held
    parts = parts if isinstance(held, (dict, list, tuple)) else ()
    return [variable for each in parts for variable in _variables(self, each)]


def test_an_array_is_made_of_none(monkeypatch):
    asked, ask = [], sooner._implementation

    def count(context, function, signature, first=True):
        asked.append(function)
        return ask(context, function, signature, first)

    monkeypatch.setattr(sooner, "_implementation", count)
    assert run(_second)(np.array([1.0, 3.0])) == 3.0
    assert asked and "__array__" not in asked


def _second(values):
    return values[1]


def test_what_is_registered_is_taken_up_once(monkeypatch):
    taken, take = [], sooner._load

    def count(context):
        taken.append(context)
        take(context)

    run(_second)(np.ones(2))
    monkeypatch.setattr(sooner, "_load", count)
    run(_second)(np.ones(2))
    what = broken("keeps what is registered in lists of its registries (sooner._refresh)")
    assert not taken, what

    @numba.extending.overload(_unknown)
    def _(x):
        return lambda x: x + 1.0

    assert run(lambda x: _unknown(x))(1.0) == 2.0
    assert taken


def _unknown(x):
    """A function that numba does not know."""


def test_calls_of_llvm_for_our_kernels_are_not_timed(monkeypatch):
    heard = []

    class Listener(event.Listener):
        def on_start(self, start):
            heard.append(start)

        on_end = on_start

    what = broken("hears of LLVM's calls by callbacks in a list of its lock (jit._Undisturbed)")
    with event.install_listener("numba:llvm_lock", Listener()):
        assert numba.njit(_second)(np.ones(2)) == 1.0
        assert heard, what
        heard.clear()
        monkeypatch.setattr(jit, "_PACKAGE", __name__)
        assert run(_second)(np.ones(2)) == 1.0
        assert not heard, what
    assert jit._LLVM._cblist, "numba times others' functions as before"


COMPILED = {
    "allocating", "allocating_entry", "entry", "fused", "inlined", "inlined16", "kernel", "loop16",
    "shared",
}  # fmt: skip


def test_no_kernel_assigns_an_array_to_a_slice():
    """Numba would compile the error message for unequal lengths, too: two to three seconds."""
    found, looked = [], 0
    for path in sorted(Path(sooner.__file__).parents[1].rglob("*.py")):
        for function in ast.walk(ast.parse(path.read_text())):
            names = {getattr(each, "id", "") for each in getattr(function, "decorator_list", ())}
            if names & COMPILED:
                looked += 1
                found += [f"{path.name}:{line}" for line in _slices_assigned(function)]
    assert looked > 500 and found == []


def _slices_assigned(function):
    for each in ast.walk(function):
        if not isinstance(each, (ast.Assign, ast.AugAssign)) or ast.unparse(each.value) == "np.inf":
            continue
        for target in each.targets if isinstance(each, ast.Assign) else [each.target]:
            if any(isinstance(part, ast.Slice) for part in ast.walk(target)):
                yield each.lineno


@pytest.mark.parametrize("frozen", [False, True])
def test_what_the_compiler_made_is_not_looked_through_at_once(frozen):
    looked = []

    class Listener(event.Listener):  # is called after the engine's listener
        def on_start(self, start):
            looked.clear()

        def on_end(self, end):
            looked.append("end")

    def look(phase, info):
        looked.append(phase)

    gc.callbacks.append(look)
    gc.unfreeze()
    if frozen:
        gc.freeze()
    count = gc.get_freeze_count()
    with event.install_listener("numba:compile", Listener()):
        run(lambda x: x)(1.0)
    gc.callbacks.remove(look)
    assert gc.isenabled()
    assert gc.get_freeze_count() >= count // 2, "what somebody has frozen stays so"
    assert frozen or (looked[0], gc.get_freeze_count()) == ("end", 0)
    gc.unfreeze()

"""Which kernels answer questions about two models, and how much memory their search takes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from typing import NamedTuple

from ..kernels.base import ahead
from ..kernels.base.cache import kernel_name
from ..kernels.base.state import BreadthFirst, DepthFirst, Priority
from ..kernels.pairs.entries import ARGUMENTS, ENTRIES, is_turned
from ..kernels.pairs.parts import SEARCHES, parts_of
from ..models.hierarchy import Hierarchy
from ..models.model import Model
from .search_memory import Order, SearchKind, Traits

ORDERS = {"depth_first": DepthFirst, "priority": Priority, "breadth_first": BreadthFirst}


def entry_for(a: Hierarchy, b: Hierarchy, order: Order = "depth_first") -> Callable:
    """Return the compiled entry that answers queries about models with these hierarchies."""
    return _entry(a.tree_kind, b.tree_kind, order)


def _entry(kind_a: type, kind_b: type, order: Order) -> Callable:
    return ENTRIES[kind_a, kind_b][ORDERS[order]]


@cache
def code_of(entry: Callable) -> Callable:
    """Return the compiled code of an entry, which Python may call in its place.

    An entry chooses its code by the types of its arguments, which takes a third of a microsecond,
    though there is only one code. The code itself hardly checks them, so they have to be right.
    """
    if entry in SEARCHES:  # worker processes compile its parts
        ahead.want(kernel_name(entry.py_func))
    return entry.compile(ARGUMENTS)


@cache
def bind(entry: Callable, profile: bool, on_time: bool) -> None:
    """Compile or load an entry; if ON_TIME, also its lazy parts, so that no search has to.

    PROFILE says whether a model may be a solid of revolution.
    """
    code_of(entry)
    for part in reversed(parts_of(entry, profile)) if on_time else ():
        part.bind()  # worker processes begin with the first


class Setup(NamedTuple):
    """What a search over two models takes."""

    entry: Callable
    elements: Callable
    """The entry to list or compare elements: it treats solids of revolution as their patches."""
    turned: bool
    """Whether the entries take the second model as their first."""
    kind: SearchKind


def setup_of(
    first: Traits, second: Traits, order: Order, coherent: bool, among: Sequence[Model]
) -> Setup:
    """Return the setup of a search over two models by traits; see `Search`."""
    if among:
        return _made(first, second, order, coherent, among)
    return _usual(first, second, order, coherent)


@lru_cache(maxsize=256)  # making one takes two microseconds
def _usual(first: Traits, second: Traits, order: Order, coherent: bool) -> Setup:
    return _made(first, second, order, coherent, ())


def _made(
    first: Traits, second: Traits, order: Order, coherent: bool, among: Sequence[Model]
) -> Setup:
    trees = first[1], second[1]
    turned = is_turned(*trees)
    in_turn = (second, first) if turned else (first, second)
    return Setup(
        _entry(first[0], second[0], order), _entry(*trees, order), turned,
        SearchKind.of(*in_turn, order, coherent, among),
    )  # fmt: skip

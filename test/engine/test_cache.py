"""The cache uses no file that is broken or that another user could have written.

Most tests use the one kernel that compiles fastest.
"""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import tempfile
from collections import defaultdict
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

import pytest

from proximity_monitor.engine import kernels
from proximity_monitor.engine.kernels.base import cache

ASK = (
    "import numpy; from proximity_monitor.engine.poses import check_pose; check_pose(numpy.eye(4))"
)
ROOT = os.geteuid() == 0
NOBODY = 65534


def run(code, place, **environment):
    """Run code in a process, check that it succeeds, and return its standard error."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(place), **environment}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stderr


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    """Return a cache root that holds one kernel."""
    place = tmp_path_factory.mktemp("warm")
    run(ASK, place)
    return place


@pytest.fixture
def kept(warm, tmp_path):
    """Return a copy of that kernel's file in another cache root."""
    (file,) = warm.rglob("*.nbc")
    copy = tmp_path / file.relative_to(warm)
    copy.parent.mkdir(parents=True)
    copy.write_bytes(file.read_bytes())
    return copy


BROKEN = """
import os, sys
from pathlib import Path
import numpy as np
from proximity_monitor.engine.kernels.base import cache, jit, motion

class Opened:
    def __reduce__(self):
        return os.mkdir, (sys.argv[1] + ".executed",)

file = Path(sys.argv[1])
whole = file.read_bytes()
flipped = bytearray(whole)
flipped[len(whole) // 2] ^= 4
planted = cache.dumps(Opened())
damages = {
    "empty": b"",
    "short": whole[:3],
    "half": whole[: len(whole) // 2],
    "zeros": bytes(len(whole)),
    "one bit": bytes(flipped),
    "others may write": cache._checksum(planted, file.name) + planted,
}

def asked():
    kernel = jit.entry(motion.pose_deviation.py_func)
    assert kernel(np.eye(4)) == 0.0
    return sum(kernel.stats.cache_hits.values())

for damage, content in damages.items():
    file.unlink()
    file.write_bytes(content)
    file.chmod(0o666 if damage == "others may write" else 0o644)
    before = len(cache.refused)
    assert asked() == 0, damage
    assert len(cache.refused) == before + 1, damage
    assert asked() == 1, "kept anew"
    assert not os.path.exists(sys.argv[1] + ".executed")
"""


@pytest.mark.long
def test_what_is_broken_or_could_be_anothers_is_made_anew(kept):
    code = BROKEN.replace("sys.argv[1]", repr(str(kept)))
    said = run(code, kept.parents[2]).splitlines()
    assert len(said) == 1
    assert f"not used: {kept}: broken" in said[0]


@pytest.mark.long
def test_a_truncated_file_costs_one_line_once(kept):
    kept.write_bytes(kept.read_bytes()[:1000])
    said = run(ASK, kept.parents[2]).splitlines()
    assert len(said) == 1
    assert "compiling proximity_monitor's kernels" in said[0]
    assert str(kept) in said[0]
    assert run(ASK, kept.parents[2]) == ""


def test_a_file_under_another_name_is_broken(kept):
    """For example, a link to the file of another function."""
    with kept.open("rb") as file, pytest.raises(ValueError, match="broken"):
        cache._read(file, "search.search-0.nbc")


@pytest.mark.long
def test_no_home_no_user_and_nothing_temporary_is_no_error(tmp_path):
    """Without a place, kernels are not cached, and the process says so."""
    nowhere = (
        "import pwd, tempfile\n"
        "def missing(*_):\n    raise KeyError\n"
        "def none():\n    raise FileNotFoundError\n"
        "pwd.getpwuid, tempfile.gettempdir = missing, none\n"
    )
    unknown = {name: "" for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    code = "import os; del os.environ['HOME']\n" + nowhere + ASK
    said = run(code, "", **unknown)
    assert "not kept" in said
    assert "NUMBA_CACHE_DIR" in said


@pytest.fixture
def places(tmp_path, monkeypatch):
    """Make the chosen root unusable (it is a file). Return the root in a temporary folder."""
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    monkeypatch.setattr(cache, "refused", [])
    return temporary / f"proximity_monitor-{os.geteuid()}"


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


@pytest.mark.parametrize("umask", [0o000, 0o002, 0o077])
def test_the_fallback_belongs_to_the_user_alone(places, umask):
    before = os.umask(umask)
    try:
        found, written = cache._directories()
    finally:
        os.umask(before)
    assert found == [written]
    assert written.parent == places
    assert mode(places) == 0o700
    assert not mode(written) & 0o022
    assert cache._directories() == (found, written), "and is found again"
    assert not cache.refused


@pytest.mark.parametrize("planted", ["writable", "link", "file", "another's"])
def test_a_fallback_that_another_made_first_is_not_used(places, planted, tmp_path):
    if planted == "writable":
        places.mkdir()
        places.chmod(0o777)
    elif planted == "link":
        (tmp_path / "elsewhere").mkdir()
        places.symlink_to(tmp_path / "elsewhere")
    elif planted == "file":
        places.touch()
    elif ROOT:
        places.mkdir(mode=0o755)
        os.chown(places, NOBODY, NOBODY)
    else:
        pytest.skip("only root can make what belongs to another")
    assert cache._directories() == ([], None)
    assert planted == "file" or cache.refused == [f"{places}: others may write there"]
    assert not places.is_dir() or not list(places.iterdir())


def test_a_place_of_the_users_choice_that_others_may_write_to_is_not_used(tmp_path, places):
    chosen = tmp_path / "chosen"
    directory = chosen / "proximity_monitor" / f"kernels-{cache.KERNELS}"
    directory.mkdir(parents=True)
    directory.chmod(0o775)
    os.environ["NUMBA_CACHE_DIR"] = str(chosen)
    found, written = cache._directories()
    assert directory not in found
    assert written.parent == places


READ_ONLY = """
import os, tempfile
from pathlib import Path
import numpy as np
from proximity_monitor.engine.kernels.base import cache, jit, motion

jit.entry(motion.pose_deviation.py_func)(np.eye(4))  # imports all that it takes
if os.geteuid() == 0:  # which may write anywhere
    os.setgid(65534)
    os.setuid(65534)
os.environ["NUMBA_CACHE_DIR"] = PLACE
found, written = cache._directories()
assert found[0] == Path(PLACE) / "proximity_monitor" / f"kernels-{cache.KERNELS}", found
assert written == found[1] and written.is_relative_to(tempfile.gettempdir()), written
cache.DIRECTORIES[:] = found
kernel = jit.entry(motion.pose_deviation.py_func)
kernel(np.eye(4))
assert sum(kernel.stats.cache_hits.values()) == 1
assert not cache.refused
"""


def test_a_complete_cache_that_is_read_only_is_used(warm):
    """For example in a container image: root made the cache, and any user reads it."""
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:
        top, temporary = Path(folder), Path(folder) / "tmp"
        temporary.mkdir()
        temporary.chmod(0o1777)
        (file,) = warm.rglob("*.nbc")
        assert mode(file) == 0o644, "whoever may read the folder may read the file"
        copy = top / "image" / file.relative_to(warm)
        copy.parent.mkdir(parents=True)
        copy.write_bytes(file.read_bytes())
        copy.chmod(0o444)
        for each in (copy.parent, *copy.parent.parents[:2], top):
            each.chmod(0o555)
        try:
            said = run(
                READ_ONLY.replace("PLACE", repr(str(top / "image"))), warm, TMPDIR=str(temporary)
            )
        finally:
            for each in (top, top / "image", copy.parents[1], copy.parent):
                each.chmod(0o755)
        assert said == ""


def test_what_the_machine_code_depends_on_is_in_the_name():
    class Code:
        def __init__(self, cpu):
            self.cpu = cpu

        def magic_tuple(self):
            return ("x86_64", self.cpu, "+avx2")

    kernel = cache.KernelCache(cache._checksum, {})
    one = kernel._name("(int64,)", Code("znver3"))
    assert one != kernel._name("(int64,)", Code("skylake")), "another processor"
    assert one != kernel._name("(float64,)", Code("znver3")), "other types"
    other = cache.KernelCache(cache._trusted, {})
    assert one != other._name("(int64,)", Code("znver3")), "another function"


def test_each_kernel_is_kept_under_a_name_of_its_own():
    """Kernels made from one function take the same arguments, so only names tell them apart."""
    names = defaultdict(set)
    for module in walk_packages(kernels.__path__, f"{kernels.__name__}."):
        for function in vars(import_module(module.name)).values():
            kept = getattr(function, "_cache", None)
            if isinstance(kept, cache._Cache):
                names[kept._about].add(function)
    assert len(names) > 30
    assert [about for about, functions in names.items() if len(functions) > 1] == []


CALLED = """
import sys
from numba import int64
from proximity_monitor.engine.kernels.base import ahead, jit

ahead.not_here()

@jit.entry
def other(x):
    return 3 * x

@jit.shared
def below(x):
    return x + 1

@jit.entry
def above(x):
    return 2 * below(x)

def again():
    other(2), other(2.0)  # first, so that numba finds another name for what comes then
    below.compile((int64,))

def ask():
    assert above(4) == 10
    sys.stderr.write(str(sum(above.stats.cache_hits.values())))
"""


@pytest.mark.long
def test_what_a_kernel_calls_is_taken_with_it_or_both_are_made_anew(tmp_path):
    """Machine code finds shared kernels by name. If a name is missing, the process ends."""
    (tmp_path / "called.py").write_text(CALLED)

    def ask(call="ask()"):
        place = str(tmp_path)
        return run(f"import sys; sys.path.append({place!r}); import called; called.{call}", place)

    assert (ask(), ask()) == ("0", "1")
    (below,) = tmp_path.rglob("called.below-*.nbc")
    below.unlink()
    assert ask() == "0", "what it called is gone"
    below.unlink()
    ask("again()")
    assert (ask(), ask()) == ("0", "1"), "what it called was made anew, under another name"


@pytest.mark.long
@pytest.mark.parametrize("setting", ["NUMBA_ENABLE_PROFILING=1", "NUMBA_LOOP_VECTORIZE=0"])
def test_what_was_made_for_a_profiler_is_for_no_other_process(kept, tmp_path, setting):
    """Otherwise one profiled process would leave slow kernels to all later ones."""
    name, _, value = setting.partition("=")
    before = kept.read_bytes()
    assert "compiling" in run(ASK, tmp_path, **{name: value})
    assert len(list(tmp_path.rglob("*.nbc"))) == 2
    assert kept.read_bytes() == before


def test_this_numba_has_every_setting_that_names_a_kernel():
    assert [each for each in cache._OPTIONS if not hasattr(cache.numba.config, each)] == []


INTERRUPTED = """
import numpy
from numba.core.registry import cpu_target
from proximity_monitor.engine.poses import check_pose
llvm = cpu_target.target_context.codegen()._engine._ee
seen, hook = set(), llvm._object_cache_{0}
def interrupt(module, *code):
    if module.name not in seen:
        seen.add(module.name)
        raise KeyboardInterrupt
    return hook(module, *code)
llvm._object_cache_{0} = interrupt
try:
    for _ in range(9):
        check_pose(numpy.eye(4))
except KeyboardInterrupt:
    check_pose(numpy.eye(4))
else:
    raise AssertionError("the interrupt was lost")
"""


@pytest.mark.parametrize("callback", ["getbuffer", "notify"])
def test_an_interrupt_while_llvm_asks_for_code_or_returns_it_is_raised(callback, warm, tmp_path):
    """Python cannot raise it in LLVM's callback. Without a check, loading then writes to address 0.

    The kernel is loaded in one case, and compiled in the other.
    """
    told = run(INTERRUPTED.format(callback), warm if callback == "getbuffer" else tmp_path)
    assert "Exception ignored on calling ctypes callback" in told

"""Ctrl-C interrupts every query, with threads as well."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

ENDLESS = 1.0
"""Seconds within which an interrupted query ends, on any machine. Without the interrupt, each
would take far longer."""

ASKED = """
import json, os, signal, sys, threading, time
import numpy as np
import trimesh
from proximity_monitor import engine

# Who starts the tests in the background may have them ignore it.
signal.signal(signal.SIGINT, signal.default_int_handler)


def ball(subdivisions, radius):
    mesh = trimesh.creation.icosphere(subdivisions, radius)
    return engine.TriangleMesh(mesh.vertices, mesh.faces)


def plate(n):
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij")
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).reshape(-1, 1)
    faces = np.concatenate((corner + [0, n + 1, n + 2], corner + [0, n + 2, 1]))
    return engine.TriangleMesh(np.stack((x, y, 0.0 * x), axis=2).reshape(-1, 3), faces)


small, shell, flat = ball(2, 1.0), ball(5, 1.0), plate(150)
outer = ball(5, 1.001)
holed = engine.TriangleMesh(shell.vertices, shell.faces[1:], solid="robust")
here = np.tile(np.eye(4), (3000, 1, 1))
lifted = np.eye(4)
lifted[2, 3] = 0.01  # every triangle of one plate is as near to one of the other
many = engine.Assembly([shell, outer])
pairs = np.tile([[0, 1]], (3000, 1))
centre = np.random.default_rng(0).normal(size=(100_000, 3)) * 1e-4
one = np.eye(4)

QUESTIONS = {
    "distance": lambda n: engine.distance(flat, one, flat, lifted, manifold=True),
    "signed_distance": lambda n: [engine.signed_distance(shell, one, outer, one) for _ in range(n)],
    "distances": lambda n: engine.distances(shell, here[:n], outer, here[:n]),
    "distances, threads": lambda n: engine.distances(shell, here[:n], outer, here[:n], threads=3),
    "Assembly": lambda n: many.distances(here[:2], pairs[:n]),
    "Assembly, threads": lambda n: many.distances(here[:2], pairs[:n], threads=3),
    "closest_points": lambda n: engine.closest_points(shell, one, centre[: 50 * n]),
    "their sides": lambda n: engine.closest_points(holed, one, centre[: 50 * n], signed=True),
    "signed": lambda n: many.distances(here[:2], pairs[:n], signed=True),
    "signed, threads": lambda n: many.distances(here[:2], pairs[:n], signed=True, threads=3),
}
took = {}
for name, ask in QUESTIONS.items():
    if name != "distance":
        ask(2)  # is compiled
    begun, sent = threading.Event(), []

    def interrupt():
        begun.wait()
        # In the midst of it: when the kernels have worked for a while.
        start = time.process_time()
        while time.process_time() - start < 0.1:
            time.sleep(0.01)
        sent.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    other = threading.Thread(target=interrupt)
    other.start()
    try:
        begun.set()
        ask(3000)
        other.join()
        took[name] = None
    except KeyboardInterrupt:
        took[name] = time.perf_counter() - sent[0]
    other.join()
assert threading.active_count() == 1, "no thread is left behind"
print(json.dumps(took))
"""


@pytest.mark.long
def test_every_question_ends_soon_after_ctrl_c():
    done = subprocess.run(
        [sys.executable, "-c", ASKED], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    took = json.loads(done.stdout)
    assert len(took) == 10
    assert all(seconds is not None and seconds < ENDLESS for seconds in took.values()), took

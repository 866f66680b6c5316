"""Signed distances of solids and parametric surfaces: their depths by dense sampling."""

from __future__ import annotations

import numpy as np
import pytest
from engine_bodies import IDENTITY, box, pose, sphere, torus, translation
from engine_surfaces import bumps, curve, patch, sphere_patches

from proximity_monitor import engine
from proximity_monitor.engine import Status

HALF = np.array([0.6, 0.5, 0.4])
BOX = box(tuple(2.0 * HALF))
BALL = engine.points([[0.0, 0.0, 0.0]], radius=0.7)
CAPSULE = engine.polyline([[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]], radius=0.3)


def phi_box(x):
    """The signed distance of points (k, 3) to the box."""
    q = np.abs(x) - HALF
    return np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)


def phi_ball(x):
    return np.linalg.norm(x, axis=1) - 0.7


def phi_capsule(x):
    nearest = np.clip(x[:, 0], -0.5, 0.5)
    return np.linalg.norm(x - np.outer(nearest, (1.0, 0.0, 0.0)), axis=1) - 0.3


SOLIDS = {"box": (BOX, phi_box), "ball": (BALL, phi_ball), "capsule": (CAPSULE, phi_capsule)}
SURFACES = {
    "bumps": bumps(3, 8),
    "rational": patch(4, (5, 4), (3, 2), decades=2.0),
    "curve": curve(5),
    "sphere": engine.ParametricSurface(sphere_patches()),
    "patches": engine.ParametricSurface([patch(6), curve(7, columns=2)]),
}


def sampled(model, count=300):
    """Points on a surface (k, 3), which lie so close that phi is known to a hundredth."""
    return np.concatenate([each.reshape(-1, 3) for each in points_of(model, count)])


def points_of(model, count):
    for each in getattr(model, "elements", (model,)):
        yield evaluated(each, count)


def evaluated(element, count):
    raise NotImplementedError

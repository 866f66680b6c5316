"""Bodies of one shape, drawn as instances of one mesh: one draw call, and one message of poses."""

from __future__ import annotations

import numpy as np
import viser

from proximity_monitor.display.inks import EDGE, linear
from proximity_monitor.display.shape import Shape


class Instances:
    """The nodes for bodies of one shape. A body that is not drawn here has the scale 0."""

    def __init__(
        self,
        api: viser.SceneApi,
        name: str,
        shape: Shape,
        colours: np.ndarray,
        levels: tuple[tuple[float, float], ...],
    ) -> None:
        """Add the nodes, with nothing to show.

        Args:
            api: takes the nodes.
            name: name of the node.
            shape: shape of each body.
            colours: (m, 3) colours of the bodies, sRGB, 0 to 255.
            levels: distances, each with the share of the triangles drawn from there on.
        """
        count = len(colours)
        self._told = {
            "batched_positions": np.zeros((count, 3), np.float32),
            "batched_wxyzs": np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1)),
            "batched_scales": np.zeros(count, np.float32),
        }
        self._mesh = api.add_batched_meshes_simple(
            name, shape.corners, shape.triangles, **self._told, batched_colors=linear(colours),
            flat_shading=shape.flat, side="double", lod=levels or "off", visible=False,
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
        self._nodes = [self._mesh]
        self._edges = None
        if len(shape.edges):
            # Only meshes have instances. So an edge is a wireframe triangle with two equal corners.
            ends = np.arange(2 * len(shape.edges)).reshape(-1, 2)
            self._edges = api.add_batched_meshes_simple(
                f"{name}/edges", shape.edges.reshape(-1, 3), ends[:, [0, 1, 1]], **self._told,
                batched_colors=EDGE, wireframe=True, lod="off",
                cast_shadow=False, receive_shadow=False,
            )  # fmt: skip
            self._nodes.append(self._edges)

    def show(
        self, poses: np.ndarray, drawn: np.ndarray, scale: float, *, opacity: float, edges: bool
    ) -> None:
        """Place the bodies; values that have not changed are not sent.

        Args:
            poses: (m, 7) poses of the bodies, metres.
            drawn: (m,) whether a body is drawn here.
            scale: units of the page per metre.
            opacity: opacity of all bodies.
            edges: whether edges are drawn.
        """
        values = (poses[:, :3] * scale, poses[:, 3:], drawn)
        for name, value in zip(self._told, values, strict=True):
            told = value.astype(np.float32)
            if not np.array_equal(told, self._told[name]):
                self._told[name] = told
                for node in self._nodes:
                    setattr(node, name, told)
        told = None if opacity >= 1.0 else opacity
        if self._mesh.opacity != told:
            self._mesh.opacity = told
        self._mesh.visible = bool(drawn.any())
        if self._edges is not None:
            self._edges.visible = edges

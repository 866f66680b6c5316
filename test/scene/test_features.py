"""Where on a model a witness point lies."""

import numpy as np
import pytest

from proximity_monitor import engine
from proximity_monitor.scene import pose_matrix
from proximity_monitor.scene.features import feature

POSE = pose_matrix((1.0, -2.0, 0.5), (0.5, -0.5, 0.5, 0.5))
TRIANGLES = {
    "proper": [[0, 0, 0], [1, 0, 0], [0.3, 2, 0.1]],
    "needle": [[0, 0, 0], [1, 1e-9, 0], [2, 0, 0]],
    "segment": [[1, 1, 1], [2, 3, 4], [1, 1, 1]],
    "point": [[1, 1, 1], [1, 1, 1], [1, 1, 1]],
}


@pytest.mark.parametrize("name", TRIANGLES)
@pytest.mark.parametrize("weights", [(1, 0, 0), (0, 0, 1), (0, 0.5, 0.5), (0.2, 0.3, 0.5)])
def test_the_place_on_the_triangle_is_the_point(name, weights):
    far = [[50, 50, 50], [51, 50, 50], [50, 51, 50]]
    model = engine.TriangleMesh([*far, *TRIANGLES[name]], [[0, 1, 2], [3, 4, 5]])
    point = POSE[:3, :3] @ (np.array(weights) @ np.array(TRIANGLES[name], float)) + POSE[:3, 3]
    found = feature(model, POSE, point)
    assert found.triangle == 1
    assert found.barycentric.min() >= 0.0
    assert found.barycentric.sum() == pytest.approx(1.0, abs=1e-15)
    own = found.barycentric @ model.vertices[model.faces[1]]
    np.testing.assert_allclose(POSE[:3, :3] @ own + POSE[:3, 3], point, atol=2e-9)

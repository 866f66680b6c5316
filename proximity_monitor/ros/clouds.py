"""Points as `sensor_msgs/PointCloud2`: clouds, and the control points of bodies that deform."""

from __future__ import annotations

import numpy as np
from sensor_msgs.msg import PointCloud2, PointField

from proximity_monitor.scene.naming import safe

_KINDS = {PointField.FLOAT32: "f4", PointField.FLOAT64: "f8"}


def control_topic(body: str, control_name: str) -> str:
    """Return the topic of a body's control points.

    Args:
        body: the body's name.
        control_name: the `control_name` of its model.
    """
    return f"bodies/{safe(body)}/{'vertices' if control_name == 'vertices' else 'control'}"


def read_points(message: PointCloud2) -> np.ndarray:
    """Return the points of a cloud, (n, 3) float64, row by row; other fields are skipped.

    Raises:
        ValueError: the cloud has no fields x, y and z of float32 or float64, or less data than the
            message claims.
    """
    order = ">" if message.is_bigendian else "<"
    fields = {field.name: field for field in message.fields}
    kinds = {}
    for name in ("x", "y", "z"):
        field = fields.get(name)
        if field is None or field.datatype not in _KINDS or field.count > 1:
            raise ValueError(f"a cloud needs one float32 or float64 field '{name}' per point")
        kinds[name] = (f"{order}{_KINDS[field.datatype]}", field.offset)
    if message.height > 1 and message.row_step < message.width * message.point_step:
        # A few bytes could claim billions of points.
        raise ValueError("the rows of the cloud overlap")
    try:
        record = np.dtype(
            {
                "names": list(kinds),
                "formats": [kind for kind, _ in kinds.values()],
                "offsets": [offset for _, offset in kinds.values()],
                "itemsize": message.point_step,
            }
        )
        points = np.ndarray(
            (message.height, message.width),
            record,
            memoryview(message.data),
            strides=(message.row_step, message.point_step),
        )
    except (TypeError, ValueError) as error:
        raise ValueError(f"the layout of the cloud does not fit its data: {error}") from error
    return np.stack([points[name].reshape(-1).astype(np.float64) for name in kinds], axis=1)

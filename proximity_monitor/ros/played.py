"""The player's messages."""

from __future__ import annotations

from array import array
from collections.abc import Mapping

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_msgs.msg import Header

from proximity_monitor.ros.parts import to_quaternion

_FIELDS = [
    PointField(name=name, offset=8 * i, datatype=PointField.FLOAT64, count=1)
    for i, name in enumerate("xyz")
]


def set_pose(message: Pose, pose: np.ndarray) -> Pose:
    """Write a pose (4, 4) in metres into a message, and return the message."""
    place, turn = message.position, message.orientation
    place.x, place.y, place.z = pose[:3, 3].tolist()
    turn.x, turn.y, turn.z, turn.w = to_quaternion(pose[:3, :3])
    return message


def as_cloud(points: np.ndarray, header: Header) -> PointCloud2:
    """Return points (n, 3) in metres as a cloud of fields x, y, z, each of 64 bits."""
    return PointCloud2(
        header=header,
        height=1,
        width=len(points),
        fields=_FIELDS,
        is_bigendian=False,
        point_step=24,
        row_step=24 * len(points),
        data=array("B", np.ascontiguousarray(points, dtype="<f8").tobytes()),
        is_dense=True,
    )


def as_joint_state(positions: Mapping[str, float], stamp: Time) -> JointState:
    """Return positions of joints by name, in radians or metres, without speeds and efforts."""
    message = JointState(name=list(positions), position=list(positions.values()))
    message.header.stamp = stamp
    return message

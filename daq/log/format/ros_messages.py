"""Scans as ROS 2 messages for stock viewers: three axes as sensor_msgs/Imu, others as arrays.

Messages are in CDR (OMG, Common Object Request Broker Architecture 3.0, chapter 15), little-endian: values are aligned
to multiples of their size, counted after the four header bytes. All messages of a device have the same layout, so that
an array of records holds many.
"""

import numpy as np
import numpy.typing as npt

from daq.types import FloatArray, IndexArray

IMU, ARRAY = "sensor_msgs/msg/Imu", "std_msgs/msg/Float64MultiArray"
_LITTLE_ENDIAN = (0, 1, 0, 0)
_SEPARATOR = "=" * 80

_TIME = "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec"
_HEADER = "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id"
_QUATERNION = "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w"
_VECTOR = "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z"
_IMU = """\
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance"""
_DIMENSION = "MSG: std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride"
_LAYOUT = "MSG: std_msgs/MultiArrayLayout\nstd_msgs/MultiArrayDimension[] dim\nuint32 data_offset"
_ARRAY = "std_msgs/MultiArrayLayout layout\nfloat64[] data"

ENCODING = "cdr"  #: encoding of messages
SCHEMAS = {
    IMU: f"\n{_SEPARATOR}\n".join((_IMU, _HEADER, _TIME, _QUATERNION, _VECTOR)),
    ARRAY: f"\n{_SEPARATOR}\n".join((_ARRAY, _LAYOUT, _DIMENSION)),
}


def schema(kind: str) -> tuple[str, str, bytes]:
    """Return name, encoding and text of the schema of a kind of messages."""
    return kind, "ros2msg", SCHEMAS[kind].encode()


def message_kind(n_axes: int) -> str:
    """Return the type of the messages of a device."""
    return IMU if n_axes == 3 else ARRAY


def encode_scans(device: str, times: IndexArray, scans: FloatArray) -> list[bytes]:
    """Return a message a scan.

    Parameters
    ----------
    device : name, used as the frame id
    times : (n,) [ns UTC]
    scans : (n, n_axes) [m/s2]
    """
    records = _imu(device, times, scans) if scans.shape[1] == 3 else _array(scans)
    return [record.tobytes() for record in records]


def _imu(device: str, times: IndexArray, scans: FloatArray) -> npt.NDArray[np.void]:
    """Return messages without orientation and angular rate, marked unknown by a covariance of -1."""
    frame = device.encode() + b"\0"
    padding = -(12 + len(frame)) % 8
    kind = np.dtype(
        [
            ("encapsulation", "u1", 4),
            ("sec", "<i4"),
            ("nanosec", "<u4"),
            ("length", "<u4"),
            ("frame_id", "u1", len(frame)),
            ("padding", "u1", padding),
            ("orientation", "<f8", 4),
            ("orientation_covariance", "<f8", 9),
            ("angular_velocity", "<f8", 3),
            ("angular_velocity_covariance", "<f8", 9),
            ("linear_acceleration", "<f8", 3),
            ("linear_acceleration_covariance", "<f8", 9),
        ]
    )
    records = np.zeros(len(scans), kind)
    records["encapsulation"] = _LITTLE_ENDIAN
    records["sec"], records["nanosec"] = times // 10**9, times % 10**9
    records["length"], records["frame_id"] = len(frame), np.frombuffer(frame, np.uint8)
    records["orientation"][:, 3] = 1.0
    records["orientation_covariance"][:, 0] = records["angular_velocity_covariance"][:, 0] = -1.0
    records["linear_acceleration"] = scans
    return records


def _array(scans: FloatArray) -> npt.NDArray[np.void]:
    """Return messages of bare values, without names of dimensions."""
    n_axes = scans.shape[1]
    kind = np.dtype(
        [
            ("encapsulation", "u1", 4),
            ("dimensions", "<u4"),
            ("data_offset", "<u4"),
            ("length", "<u4"),
            ("padding", "u1", 4),
            ("data", "<f8", n_axes),
        ]
    )
    records = np.zeros(len(scans), kind)
    records["encapsulation"], records["length"], records["data"] = _LITTLE_ENDIAN, n_axes, scans
    return records

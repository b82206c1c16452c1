"""Bags with IMU messages, written by rosbags."""

import warnings
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

CUSTOM = "lab_msgs/msg/Array"
CUSTOM_TEXT = "std_msgs/Header header\nfloat32[4] rates\nint16[] counts\nstring note\nsensor_msgs/Imu imu\n"
EPOCH = 1_700_000_000_000_000_000


def store(ros1: bool):
    made = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    made.register(get_types_from_msg(CUSTOM_TEXT, CUSTOM))
    return made


def header(types, ros1: bool, index: int, time: int):
    stamp = types.types["builtin_interfaces/msg/Time"](time // 10**9, time % 10**9)
    made = types.types["std_msgs/msg/Header"]
    return made(index, stamp, "imu") if ros1 else made(stamp, "imu")


def imu(types, ros1: bool, index: int, rate):
    vector, quaternion = types.types["geometry_msgs/msg/Vector3"], types.types["geometry_msgs/msg/Quaternion"]
    covariance = np.arange(9.0) + index
    return types.types["sensor_msgs/msg/Imu"](
        header(types, ros1, index, EPOCH + index * 10**7 + 3), quaternion(0.0, 0.0, 0.0, 1.0), covariance,
        vector(*rate), covariance, vector(0.1, 0.2, 9.8), covariance,
    )  # fmt: skip


def write_bag(path: Path, kind: str, rates: np.ndarray, custom: bool = False, compression: str = "") -> Path:
    """rates [T, 3] as /imu0, their negative as /imu1, every 10 ms. kind: ros1, sqlite or mcap. Gives what to open."""
    ros1 = kind == "ros1"
    types = store(ros1)
    serialize = types.serialize_ros1 if ros1 else types.serialize_cdr
    if ros1:
        writer = Writer1(path)
        if compression:
            writer.set_compression(Writer1.CompressionFormat[compression.upper()])
    else:
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            writer = Writer2(path, version=9, storage_plugin=plugin)
        if compression:
            writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    with writer:
        topics = [writer.add_connection(name, "sensor_msgs/msg/Imu", typestore=types) for name in ("/imu0", "/imu1")]
        text = writer.add_connection("/chatter", "std_msgs/msg/String", typestore=types)
        extra = writer.add_connection("/array", CUSTOM, typestore=types) if custom else None
        for index, rate in enumerate(rates):
            time = EPOCH + index * 10**7
            writer.write(topics[0], time, serialize(imu(types, ros1, index, rate), "sensor_msgs/msg/Imu"))
            writer.write(topics[1], time + 1000, serialize(imu(types, ros1, index, -rate), "sensor_msgs/msg/Imu"))
            if extra:
                message = types.types[CUSTOM](
                    header(types, ros1, index, time), np.float32([index, 1, 2, 3]), np.int16([index, -index, 7]), "x",
                    imu(types, ros1, index, rate),
                )  # fmt: skip
                writer.write(extra, time + 2000, serialize(message, CUSTOM))
        said = types.types["std_msgs/msg/String"]("hello")
        writer.write(text, EPOCH, serialize(said, "std_msgs/msg/String"))
    return path

#!/usr/bin/env python3
"""A node of ROS 2 between a simulated infrared camera and what reads it: ideal images in, a real camera's codes out.

    python3 examples/ros2/speckle_node.py --ros-args -r image:=/ir/image_raw -r codes:=/ir/codes \\
        -p camera.f_number:=4.0 -p camera.bits:=10 -p camera.exposure_gain_dn:=600.0 -p effects.defocus.waves:=0.4

| topic | message | holds |
|---|---|---|
| image | sensor_msgs/Image, 32FC1, mono8 or mono16 | the ideal infrared image, linear; codes by their top code |
| codes | sensor_msgs/Image, mono16 | what the camera records, with the header of the ideal image |

| parameter | is |
|---|---|
| camera.NAME | one of clspeckle.PipelineParameters |
| effects.ID.NAME | a parameter of an effect of the catalogue; those that are left out take the middle |
| profile | a camera profile (JSON) in place of `camera` |
| new_speckle | true (default): each image has speckle of its own, as on a robot that moves; false: the scene rests |

Gazebo's camera publishes such images by ros_gz_bridge. Needs rclpy and sensor_msgs of any ROS 2, NumPy and clspeckle.
"""

from __future__ import annotations

import array
import sys

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image

import clspeckle

ENCODINGS = {"32FC1": np.float32, "mono8": np.uint8, "8UC1": np.uint8, "mono16": np.uint16, "16UC1": np.uint16}


def pixels_of(message: Image) -> np.ndarray:
    """(height, width) of a message, whose rows may have bytes behind them."""
    dtype = np.dtype(ENCODINGS[message.encoding]).newbyteorder(">" if message.is_bigendian else "<")
    row = message.width * dtype.itemsize
    data = np.frombuffer(message.data, np.uint8)
    if message.step < row or data.size < message.step * message.height:
        raise ValueError(f"it has {data.size} bytes in rows of {message.step}, too few for its {message.width} pixels")
    rows = data[: message.step * message.height].reshape(message.height, message.step)[:, :row]
    return np.ascontiguousarray(rows).view(dtype).astype(dtype.newbyteorder("="))


def message_of(codes: np.ndarray, like: Image) -> Image:
    """Codes as a message with the header of another one."""
    message = Image()
    message.header = like.header
    message.height, message.width = codes.shape
    message.encoding = "mono16"
    message.is_bigendian = 0
    message.step = 2 * message.width
    message.data = array.array("B", codes.astype("<u2").tobytes())
    return message


class Speckle(Node):
    """Makes a camera for the size of the first image, and another one where the size changes."""

    def __init__(self) -> None:
        super().__init__("speckle", automatically_declare_parameters_from_overrides=True)
        self.camera: clspeckle.Pipeline | None = None
        self.publisher = self.create_publisher(Image, "codes", qos_profile_sensor_data)
        self.create_subscription(Image, "image", self.take, qos_profile_sensor_data)

    def told(self, prefix: str) -> dict:
        return {name: parameter.value for name, parameter in self.get_parameters_by_prefix(prefix).items()}

    def make(self, shape: tuple[int, int]) -> clspeckle.Pipeline:
        effects: dict[str, dict[str, float]] = {}
        for name, value in self.told("effects").items():
            effect, _, parameter = name.partition(".")
            effects.setdefault(effect, {})[parameter] = value
        own = {**self.told("camera"), **({"effects": effects} if effects else {})}
        if self.has_parameter("profile"):
            profile = clspeckle.Profile.open(self.get_parameter("profile").value)
            if profile.shape != shape:
                raise ValueError(f"the profile is of {profile.shape} pixels, the image has {shape}")
            return clspeckle.Pipeline.from_profile(profile, **own)
        return clspeckle.Pipeline.from_parameters(shape, **own)

    def take(self, message: Image) -> None:
        if message.encoding not in ENCODINGS:
            self.get_logger().error(f"an image has the encoding {message.encoding}; expected {', '.join(ENCODINGS)}")
            return
        try:
            ideal = pixels_of(message)
            if self.camera is None or self.camera.shape != ideal.shape:
                self.camera = self.make(ideal.shape)
            renews = not self.has_parameter("new_speckle") or self.get_parameter("new_speckle").value
            codes = self.camera.render(ideal, refresh="all" if renews else None)
        except (clspeckle.errors.ClspeckleError, TypeError, ValueError) as error:
            self.get_logger().error(f"an image is left out: {error}")
            return
        self.publisher.publish(message_of(codes, message))


def main(words: list[str] | None = None) -> int:
    rclpy.init(args=words)
    node = Speckle()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""The node of ROS 2, against a stub of the part of rclpy and sensor_msgs that it calls."""

from __future__ import annotations

import array
import importlib
import sys
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clspeckle

ROOT = Path(__file__).resolve().parents[2]
SHAPE = (24, 32)
CAMERA = {"f_number": 4.0, "bits": 10, "exposure_gain_dn": 300.0, "seed": 5}


class Message:
    """sensor_msgs/Image: its fields and no others, of their types, as the generated classes check them."""

    __slots__ = ("_data", "encoding", "header", "height", "is_bigendian", "step", "width")

    def __init__(self) -> None:
        self.header, self.encoding = types.SimpleNamespace(frame_id="", stamp=None), ""
        self.height = self.width = self.step = self.is_bigendian = 0
        self._data = array.array("B")

    @property
    def data(self) -> array.array[int]:
        return self._data

    @data.setter
    def data(self, value: Any) -> None:
        assert isinstance(value, array.array) and value.typecode == "B"
        self._data = value

    def check(self) -> None:
        for name, top in (("height", 2**32), ("width", 2**32), ("step", 2**32), ("is_bigendian", 256)):
            value = getattr(self, name)
            assert type(value) is int and 0 <= value < top, name
        assert isinstance(self.encoding, str)
        assert len(self.data) == self.step * self.height


class Parameter:
    def __init__(self, value: Any) -> None:
        self.value = value


class Ros:
    """What the node told the stub."""

    def __init__(self, overrides: dict[str, Any]) -> None:
        self.overrides = overrides
        self.published: list[Message] = []
        self.errors: list[str] = []
        self.calls: list[str] = []
        self.take: Callable[[Message], None] | None = None
        self.sent: list[Message] = []


@pytest.fixture
def start(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Ros]]:
    def run(*messages: Message, **overrides: Any) -> Ros:
        ros = Ros({name.replace("__", "."): value for name, value in overrides.items()})
        ros.sent = list(messages)

        class Node:
            def __init__(self, name: str, *, automatically_declare_parameters_from_overrides: bool = False) -> None:
                assert name == "speckle" and automatically_declare_parameters_from_overrides

            def create_publisher(self, kind: type, topic: str, qos: object) -> Any:
                assert (kind, topic, qos) == (Message, "codes", "sensor data")
                return types.SimpleNamespace(publish=ros.published.append)

            def create_subscription(self, kind: type, topic: str, take: Any, qos: object) -> Any:
                assert (kind, topic, qos) == (Message, "image", "sensor data")
                ros.take = take

            def has_parameter(self, name: str) -> bool:
                return name in ros.overrides

            def get_parameter(self, name: str) -> Parameter:
                return Parameter(ros.overrides[name])

            def get_parameters_by_prefix(self, prefix: str) -> dict[str, Parameter]:
                start = prefix + "."
                return {
                    name[len(start) :]: Parameter(value)
                    for name, value in ros.overrides.items()
                    if name.startswith(start)
                }

            def get_logger(self) -> Any:
                return types.SimpleNamespace(error=ros.errors.append)

            def destroy_node(self) -> None:
                ros.calls.append("destroy_node")

        def spin(_node: Node) -> None:
            assert ros.take is not None
            for message in ros.sent:
                ros.take(message)
            raise KeyboardInterrupt

        rclpy: Any = types.ModuleType("rclpy")
        rclpy.init = lambda args=None: ros.calls.append("init")
        rclpy.spin, rclpy.try_shutdown = spin, lambda: ros.calls.append("shutdown")
        parts = {"node": {"Node": Node}, "qos": {"qos_profile_sensor_data": "sensor data"}}
        monkeypatch.setitem(sys.modules, "rclpy", rclpy)
        for name, content in parts.items():
            module = types.ModuleType(f"rclpy.{name}")
            module.__dict__.update(content)
            monkeypatch.setitem(sys.modules, f"rclpy.{name}", module)
        for name, content in (("sensor_msgs", {}), ("sensor_msgs.msg", {"Image": Message})):
            module = types.ModuleType(name)
            module.__dict__.update(content)
            monkeypatch.setitem(sys.modules, name, module)
        monkeypatch.syspath_prepend(str(ROOT / "examples" / "ros2"))
        monkeypatch.delitem(sys.modules, "speckle_node", raising=False)
        assert importlib.import_module("speckle_node").main([]) == 0
        assert ros.calls == ["init", "destroy_node", "shutdown"]
        for message in ros.published:
            message.check()
        return ros

    yield run
    sys.modules.pop("speckle_node", None)


def message(image: Any, encoding: str, padding: int = 0, big: bool = False) -> Message:
    made = Message()
    made.header.frame_id = "ir_optical_frame"
    made.height, made.width = image.shape
    made.encoding, made.is_bigendian = encoding, int(big)
    rows = image.astype(image.dtype.newbyteorder(">" if big else "<"))
    rows = rows.view(np.uint8).reshape(image.shape[0], -1)
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=0xAB)
    made.step = rows.shape[1]
    made.data = array.array("B", rows.tobytes())
    return made


def codes_of(made: Message) -> Any:
    assert made.encoding == "mono16" and made.step == 2 * made.width and not made.is_bigendian
    return np.frombuffer(made.data, "<u2").reshape(made.height, made.width)


@pytest.fixture
def ideal() -> Any:
    return np.random.default_rng(4).random(SHAPE, np.float32)


def test_codes_are_those_of_the_pipeline(start: Callable[..., Ros], ideal: Any) -> None:
    """Of all encodings, with bytes behind the rows and of either byte order; each image has speckle of its own."""
    eight = (255 * ideal).astype(np.uint8)
    overrides = {f"camera__{name}": value for name, value in CAMERA.items()}
    ros = start(
        message(ideal, "32FC1"),
        message(ideal, "32FC1", padding=12, big=True),
        message(eight, "mono8", padding=5),
        message(eight.astype(np.uint16) * 257, "mono16", big=True),
        **overrides,
        effects__defocus__waves=0.4,
        effects__row_noise__sigma_dn=3.0,
    )
    assert not ros.errors
    effects = {"defocus": {"waves": 0.4}, "row_noise": {"sigma_dn": 3.0}}
    with clspeckle.Pipeline.from_parameters(SHAPE, effects=effects, **CAMERA) as camera:
        expected = [camera.render(image, refresh="all") for image in (ideal, ideal, eight, eight)]
    assert len(ros.published) == 4
    for made, codes in zip(ros.published, expected, strict=True):
        assert np.array_equal(codes_of(made), codes)
        assert made.header.frame_id == "ir_optical_frame"


def test_a_scene_at_rest_keeps_its_speckle(start: Callable[..., Ros], ideal: Any) -> None:
    quiet = {"camera__read_noise_dn": 0.0, "camera__shot_noise": False, "camera__exposure_gain_dn": 300.0}
    rests = start(message(ideal, "32FC1"), message(ideal, "32FC1"), new_speckle=False, **quiet)
    assert np.array_equal(codes_of(rests.published[0]), codes_of(rests.published[1]))
    moves = start(message(ideal, "32FC1"), message(ideal, "32FC1"), **quiet)
    assert not np.array_equal(codes_of(moves.published[0]), codes_of(moves.published[1]))


def test_what_cannot_be_taken_is_told_and_left_out(start: Callable[..., Ros], ideal: Any) -> None:
    colors = message(ideal, "rgb8")
    short = message(ideal, "32FC1")
    short.data = short.data[:-4]
    dark = message(np.full(SHAPE, np.nan, np.float32), "32FC1")
    other = message(ideal[:16], "32FC1")
    ros = start(colors, short, dark, other, message(ideal, "32FC1"), camera__exposure_gain_dn=300.0)
    assert [codes_of(made).shape for made in ros.published] == [(16, 32), SHAPE]
    told = "\n".join(ros.errors)
    assert "has the encoding rgb8; expected 32FC1, mono8" in told
    assert "too few for its 32 pixels" in told
    assert "NaN" in told or "finite" in told
    assert len(ros.errors) == 3
    wrong = start(message(ideal, "32FC1"), camera__f_numbre=4.0)
    assert not wrong.published
    assert "f_numbre" in wrong.errors[0]


def test_a_profile_is_the_camera(start: Callable[..., Ros], ideal: Any, tmp_path: Path) -> None:
    ros = start(message(ideal, "32FC1"), profile=str(tmp_path / "none.json"))
    assert "none.json" in ros.errors[0]

"""One rule for every image that is named: FILE:CHANNEL, and names that tell which channels are meant."""

from __future__ import annotations

import json
import re
from pathlib import Path

import cli_images as images
import imageio.v3 as iio
import numpy as np
import OpenEXR
import pytest
import tifffile
from test_cli_scene import (
    CAMERA,
    LASER,
    PATTERN,
    albedo,
    depth,
    normal,
    position,
    rendered,
    scene,
    sequence,
    visibility,
)

__all__ = ["scene"]

ARGUMENTS = ["-o", "out", *CAMERA, *PATTERN, *LASER]
COLORS = {c: np.random.default_rng(i).random(depth().shape, dtype=np.float32) for i, c in enumerate("RGB")}


def vector(layer: str, plane: np.ndarray, axes: str = "XYZ") -> dict[str, np.ndarray]:
    return {f"{layer}.{axis}": np.ascontiguousarray(plane[..., i]) for i, axis in enumerate(axes)}


def colors(layer: str = "") -> dict[str, np.ndarray]:
    return {layer + name: plane for name, plane in COLORS.items()}


def options(**names: str) -> list[str]:
    return [word for name, file in names.items() for word in (f"--{name.replace('_', '-')}", file)]


@pytest.fixture
def expected(ok, scene: Path) -> np.ndarray:
    return rendered(ok, scene, "--depth", "z.npy", "--normal", "n.npy", *CAMERA)


BLENDER = {
    **colors("ViewLayer.Combined."),
    "ViewLayer.Combined.A": np.ones_like(depth()),
    "ViewLayer.Depth.Z": depth(),
    "ViewLayer.Mist.Z": visibility(),
    **vector("ViewLayer.Normal", normal()),
    **vector("ViewLayer.Position", position()),
}


@pytest.mark.parametrize(
    "planes",
    [
        BLENDER,
        {"Z": depth(), **colors(), **vector("N", normal())},
        {"Depth.V": depth(), **vector("Normal", normal()), **vector("P", position())},
        {"depth.Z": depth(), **colors("beauty."), **vector("normals", normal())},
        {"depth": depth(), **colors(), **vector("normals", normal(), "RGB")},
        {"VRayZDepth.Y": depth(), **vector("Normals", normal())},
        {"left.Z": depth(), **vector("N", normal())},
    ],
)
def test_names_tell_depth_and_normals(ok, scene: Path, expected: np.ndarray, planes: dict) -> None:
    images.exr(scene / "all.exr", planes)
    np.testing.assert_array_equal(
        rendered(ok, scene, *options(depth="all.exr", normal="all.exr"), *CAMERA),
        expected,
    )


@pytest.mark.parametrize(
    "planes",
    [
        {"Z": depth(), **vector("Normal", normal()), "Albedo": albedo()},
        {"z": depth(), **vector("N", normal(), "xyz"), "albedo.V": albedo()},
        {"Depth.V": depth(), **vector("normals", normal(), "RGB"), **{f"albedo.{c}": albedo() for c in "RGB"}},
        {**colors(), "Z": depth(), **vector("View.Normal", normal()), "View.albedo": albedo()},
        {"left.Z": depth(), "unknown": visibility(), **vector("N", normal()), "albedo": albedo()},
    ],
)
def test_a_scene_in_one_file_has_the_rule_of_the_planes(ok, scene: Path, planes: dict) -> None:
    images.exr(scene / "all.exr", planes)
    one_by_one = options(depth="z.npy", normal="n.npy", albedo="a.npy")
    np.testing.assert_array_equal(rendered(ok, scene, "all.exr", *CAMERA), rendered(ok, scene, *one_by_one, *CAMERA))


def test_masks_and_ids_of_a_renderer_are_none_of_a_scene(ok, scene: Path) -> None:
    """What is there, and which material: neither says where speckle is new, nor what a surface is made of."""
    channels = {"Z": depth(), "mask": np.ones_like(depth()), "IndexMA.V": np.full_like(depth(), 700)}
    images.exr(scene / "all.exr", channels)
    command = [*CAMERA, *PATTERN, *LASER, "--frames", 2, "--format", "npy", "--no-preview", "--exposure-gain", 30000]
    ok("render", "all.exr", "-o", "one", *command)
    ok("render", "--depth", "z.npy", "-o", "two", *command)
    for name in ("frame_000000.npy", "frame_000001.npy"):
        np.testing.assert_array_equal(np.load(scene / "one" / name), np.load(scene / "two" / name))


def test_positions_of_a_scene_are_found_by_their_layer(ok, scene: Path) -> None:
    images.exr(scene / "all.exr", {**vector("Position", position(), "xyz"), **vector("Normal", normal())})
    one_by_one = options(position="p.npy", normal="n.npy")
    np.testing.assert_array_equal(rendered(ok, scene, "all.exr"), rendered(ok, scene, *one_by_one))


def test_a_scene_in_which_several_planes_fit_is_refused_with_a_way_out(ok, refused, scene: Path) -> None:
    images.exr(scene / "two.exr", {"Z": depth(), **vector("a.N", normal()), **vector("b.N", -normal())})
    message = refused("render", "two.exr", *ARGUMENTS)
    advised = re.search(r"several of its channels may be the normal: .* name one: (--normal) (\S+)", message)
    assert advised and advised[2] == "two.exr:a.N.X,a.N.Y,a.N.Z"
    expected = rendered(ok, scene, *options(depth="z.npy", normal="n.npy"), *CAMERA)
    np.testing.assert_array_equal(rendered(ok, scene, "two.exr", *advised.groups(), *CAMERA), expected)
    images.exr(scene / "two.exr", {"a.Depth.Z": depth(), "b.Depth.Z": depth() * 2})
    message = refused("render", "two.exr", *ARGUMENTS)
    advised = re.search(r"in place of the file, and the other planes likewise: (--depth) (\S+)", message)
    assert advised and advised[2] == "two.exr:a.Depth.Z"
    rendered(ok, scene, *advised.groups(), *CAMERA)


def test_frames_in_which_several_planes_fit_are_refused_with_a_way_out(ok, refused, scene: Path) -> None:
    """An option would give all frames the plane of one."""
    planes = [{"normal": normal(), "albedo": albedo()}, {"normal": -normal(), "albedo": albedo() / 2}]
    own = {"normal": "N.X,N.Y,N.Z", "albedo": "albedo"}
    command = ["render", "q0.exr", "q1.exr", *CAMERA, *PATTERN, *LASER, "--exposure-gain", 30000, "--format", "npy",
               "--no-preview", "-o"]  # fmt: skip
    for plane in own:
        for i, given in enumerate(planes):
            layers = {"a.N": given["normal"], "b.N": normal()} if plane == "normal" else {}
            channels = {name: value for layer, one in layers.items() for name, value in vector(layer, one).items()}
            channels |= {} if layers else {"a.albedo": given["albedo"], "b.albedo": albedo()}
            images.exr(scene / f"q{i}.exr", {"Z": depth(), **channels})
        message = refused(*command, "refused")
        advised = re.search(
            rf"may be the {plane}: .*; save those that are meant as (\S+), in the file of each", message
        )
        assert advised and advised[1] == own[plane]
        for i, given in enumerate(planes):
            named = vector("N", given["normal"]) if plane == "normal" else {"albedo": given["albedo"]}
            images.exr(scene / f"q{i}.exr", {"Z": depth(), **named, **vector("b.N", normal()), "b.albedo": albedo()})
        ok(*command, plane)
        frames = [np.load(scene / plane / f"frame_{i:06}.npy") for i in range(2)]
        assert frames[1].mean() < 0.9 * frames[0].mean()


def test_colors_in_a_scene_are_no_number(ok, refused, scene: Path) -> None:
    layer = {f"albedo.{c}": plane / 2 for c, plane in COLORS.items()}
    images.exr(scene / "colors.exr", {"Z": depth(), **layer})
    assert "their mean is taken" in ok("render", "colors.exr", *ARGUMENTS).err
    images.exr(scene / "colors.exr", {"Z": depth(), **{f"visibility.{c}": plane for c, plane in COLORS.items()}})
    message = refused("render", "colors.exr", *ARGUMENTS)
    assert "the color channels of its visibility" in message and "save one of them as visibility" in message
    images.exr(scene / "colors.exr", {"Z": depth(), "visibility": COLORS["R"]})
    ok("render", "colors.exr", *ARGUMENTS)


def test_parts_of_one_file(ok, scene: Path, expected: np.ndarray) -> None:
    xyz = {axis: np.ascontiguousarray(normal()[..., i]) for i, axis in enumerate("XYZ")}
    images.exr_parts(scene / "parts.exr", rgba=colors(), depth={"Z": depth()}, normal=xyz)
    both = options(depth="parts.exr", normal="parts.exr")
    np.testing.assert_array_equal(rendered(ok, scene, *both, *CAMERA), expected)
    named = options(depth="parts.exr:depth.Z", normal="parts.exr:normal")
    np.testing.assert_array_equal(rendered(ok, scene, *named, *CAMERA), expected)
    ok(
        "render",
        "parts.exr",
        "-o",
        "red",
        "--channel",
        "R",
        "--save-ideal",
        "--no-preview",
    )
    np.testing.assert_array_equal(np.load(scene / "red" / "ideal_000000.npy"), COLORS["R"])
    ok("render", "parts.exr", "-o", "mean", "--save-ideal", "--no-preview")
    mean = np.mean([plane.astype(float) for plane in COLORS.values()], axis=0).astype(np.float32)
    np.testing.assert_array_equal(np.load(scene / "mean" / "ideal_000000.npy"), mean)


def test_blender_names_its_parts_in_its_channels(ok, scene: Path, expected: np.ndarray) -> None:
    layers: dict[str, dict[str, np.ndarray]] = {}
    for name, plane in BLENDER.items():
        layers.setdefault(name.rsplit(".", 1)[0], {})[name] = plane
    images.exr_parts(scene / "parts.exr", **layers)
    np.testing.assert_array_equal(
        rendered(ok, scene, *options(depth="parts.exr", normal="parts.exr"), *CAMERA),
        expected,
    )


def test_parts_with_windows_of_their_own(ok, scene: Path, expected: np.ndarray) -> None:
    """A renderer stores of each part what is not empty; the rest of the depth is 0, no surface."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    display = (
        np.array([0, 0], np.int32),
        np.array([depth().shape[1] - 1, depth().shape[0] - 1], np.int32),
    )
    window = {
        "dataWindow": (np.array([12, 10], np.int32), np.array([23, 19], np.int32)),
        "displayWindow": display,
    }
    box = np.ascontiguousarray(depth()[10:20, 12:24])
    OpenEXR.File(
        [
            OpenEXR.Part(dict(header), colors(), "rgba"),
            OpenEXR.Part({**header, **window}, {"Z": box}, "depth"),
        ]
    ).write(str(scene / "box.exr"))
    alone = np.zeros_like(depth())
    alone[10:20, 12:24] = box
    np.save(scene / "alone.npy", alone)
    np.testing.assert_array_equal(
        rendered(ok, scene, "--depth", "box.exr", *CAMERA),
        rendered(ok, scene, "--depth", "alone.npy", *CAMERA),
    )


def advice(message: str) -> str:
    """The name that a refusal gives as an example."""
    found = re.search(r"for example (\S+?)\. Its channels", message)
    assert found, message
    return found[1]


REFUSED = {
    "depth": (colors(), "none of its channels is named as a depth"),
    "normal": (colors(), "none of its channels is named as a normal"),
    "position": (
        {**colors(), **vector("N", normal())},
        "none of its channels is named as a position",
    ),
    "albedo": (
        {"direct": albedo(), "indirect": albedo()},
        "none of its channels is named as an albedo",
    ),
    "material": (
        {"a": visibility(), "b": visibility()},
        "none of its channels is named as materials",
    ),
}


@pytest.mark.parametrize("plane", REFUSED)
def test_what_no_name_tells_is_refused_with_a_name_that_works(ok, refused, scene: Path, plane: str) -> None:
    channels, words = REFUSED[plane]
    images.exr(scene / "given.exr", channels)
    others = [] if plane in ("depth", "position") else ["--depth", "z.npy"]
    message = refused("render", f"--{plane}", "given.exr", *others, *ARGUMENTS)
    assert words in message and all(name in message for name in channels)
    ok("render", f"--{plane}", advice(message), *others, *ARGUMENTS)


@pytest.mark.parametrize(
    ("plane", "channels", "example"),
    [
        ("", ["mask.V", "mist.V"], "mist.V"),
        ("", ["A.X", "A.Y", "A.Z", "IndexMA.V", "Normal.X", "haze"], "haze"),
        ("", ["IndexMA.V", "IR", "mask.V"], "IR"),
        ("depth", ["B", "G", "R", "haze.V", "mist.V"], "haze.V"),
        ("albedo", ["Depth.V", "direct", "indirect"], "direct"),
    ],
)
def test_the_example_is_no_channel_of_another_kind(
    refused, scene: Path, plane: str, channels: list[str], example: str
) -> None:
    images.exr(scene / "given.exr", {name: visibility() for name in channels})
    planes = {"": ["given.exr", "-o", "out"], "depth": ["--depth", "given.exr", *ARGUMENTS]}
    message = refused("render", *planes.get(plane, ["--depth", "z.npy", f"--{plane}", "given.exr", *ARGUMENTS]))
    assert advice(message) == f"given.exr:{example}"


@pytest.mark.parametrize(
    ("names", "example"),
    [
        (["B", "G", "R"], "R,G,B"),
        (["sh_normal.B", "sh_normal.G", "sh_normal.R"], "sh_normal.R,sh_normal.G,sh_normal.B"),
        (["B", "G", "R", "shnormal_b", "shnormal_g", "shnormal_r"], "shnormal_r,shnormal_g,shnormal_b"),
        (["aux.x", "aux.y", "aux.z", "B", "G", "R"], "aux.x,aux.y,aux.z"),
    ],
)
def test_normals_are_offered_in_the_order_of_their_axes(
    ok, refused, scene: Path, expected: np.ndarray, names: list[str], example: str
) -> None:
    """A file sorts its channels by name, so that B comes first; x is in R."""
    order = example.split(",")
    planes = {name: visibility() for name in names}
    planes.update({name: np.ascontiguousarray(normal()[..., i]) for i, name in enumerate(order)})
    images.exr(scene / "given.exr", planes)
    message = refused("render", "--depth", "z.npy", "--normal", "given.exr", *ARGUMENTS)
    assert advice(message) == f"given.exr:{example}"
    np.testing.assert_array_equal(
        rendered(ok, scene, *options(depth="z.npy", normal=advice(message)), *CAMERA),
        expected,
    )


@pytest.mark.parametrize(
    "name",
    [
        "View.Mist.Z",
        "Light.Z",
        "inverse_depth.Z",
        "disparity.Y",
        "Normal.Z",
        "disparity",
        "Mist.left.Z",
        "normalized_depth",
    ],
)
@pytest.mark.parametrize("alone", [True, False])
def test_what_is_not_said_to_be_a_depth_is_none_unasked(ok, refused, scene: Path, name: str, alone: bool) -> None:
    images.exr(scene / "given.exr", {name: depth(), **({} if alone else colors())})
    message = refused("render", "--depth", "given.exr", *ARGUMENTS)
    assert "none of its channels is named as a depth" in message and name in message
    assert name == "Normal.Z" or advice(message) == f"given.exr:{name}"
    rendered(ok, scene, "--depth", advice(message), *CAMERA)


@pytest.mark.parametrize("name", ["Z", "Y", "View.Depth.Z", "range.Z", "distance.Y", "Depth.right.Z", "right.Z"])
def test_a_lone_depth_needs_no_name(ok, scene: Path, name: str) -> None:
    images.exr(scene / "given.exr", {name: depth()})
    np.testing.assert_array_equal(
        rendered(ok, scene, "--depth", "given.exr", *CAMERA), rendered(ok, scene, "--depth", "z.npy", *CAMERA)
    )


@pytest.mark.parametrize("name", ["albedo.V", "mask", "IndexMA.V"])
def test_a_lone_channel_that_says_what_it_is_is_no_picture_unasked(ok, refused, scene: Path, name: str) -> None:
    images.exr(scene / "given.exr", {name: visibility()})
    message = refused("render", "given.exr", "-o", "out")
    assert "none of its channels is named as a picture" in message
    ok("render", advice(message), "-o", "out", "--frames", 1)
    images.exr(scene / "given.exr", {"mask": depth()})
    message = refused("render", "--depth", "given.exr", *ARGUMENTS)
    ok("render", "--depth", advice(message), *ARGUMENTS)


def test_several_that_fit_are_listed(ok, refused, scene: Path, expected: np.ndarray) -> None:
    images.exr(
        scene / "two.exr",
        {"A.Depth.Z": depth(), "B.Depth.Z": depth() * 2, **vector("A.N", normal())},
    )
    message = refused("render", *options(depth="two.exr", normal="two.exr"), *ARGUMENTS)
    assert "several of its channels may be a depth" in message and "A.Depth.Z, B.Depth.Z" in message
    named = options(depth=advice(message), normal="two.exr:A.N")
    np.testing.assert_array_equal(rendered(ok, scene, *named, *CAMERA), expected)
    images.exr(scene / "pictures.exr", {**colors("one."), **colors("two.")})
    message = refused("render", "pictures.exr", "-o", "out")
    assert "several of its channels may be a picture" in message
    ok("render", advice(message), "-o", "out")


def test_a_picture_with_depth_is_an_image_or_a_scene(ok, refused, scene: Path) -> None:
    images.exr(scene / "beauty.exr", {**colors(), "A": np.ones_like(depth()), "Z": depth()})
    images.exr(scene / "colors.exr", colors())
    image = ok("render", "beauty.exr", "-o", "image", "--save-ideal", "--no-preview")
    assert "taken as an ideal image; --pattern IMAGE makes a scene of all its planes" in image.err
    ok("render", "colors.exr", "-o", "colors", "--save-ideal", "--no-preview")
    ideal = [np.load(scene / folder / "ideal_000000.npy") for folder in ("image", "colors")]
    np.testing.assert_array_equal(*ideal)
    expected = rendered(ok, scene, "--depth", "z.npy", *CAMERA)
    np.testing.assert_array_equal(rendered(ok, scene, "--depth", "beauty.exr", *CAMERA), expected)
    np.testing.assert_array_equal(rendered(ok, scene, "beauty.exr", *CAMERA), expected)  # a pattern asks for a scene
    ok("render", "beauty.exr:G", "-o", "green", "--save-ideal", "--no-preview")
    np.testing.assert_array_equal(np.load(scene / "green" / "ideal_000000.npy"), COLORS["G"])
    ok(
        "render",
        "beauty.exr",
        "--channel",
        "Z",
        "-o",
        "z",
        "--save-ideal",
        "--no-preview",
    )
    np.testing.assert_array_equal(np.load(scene / "z" / "ideal_000000.npy"), depth())
    assert "two channels are named" in refused("render", "beauty.exr:G", "--channel", "R", "-o", "out")


@pytest.mark.parametrize(
    "geometry",
    [{"ViewLayer.Depth.Z": depth()}, {"Depth.V": depth()}, {"Z": depth()}, vector("Position", position()),
     vector("View.Position", position(), "xyz")],
    ids=lambda planes: next(iter(planes)),
)  # fmt: skip
def test_a_picture_with_any_named_geometry_is_told_how_it_is_a_scene(ok, scene: Path, geometry: dict) -> None:
    """With all its planes; so is one of a sequence."""
    pictures = {f"ViewLayer.Combined.{name}": plane for name, plane in colors().items()}
    planes = {**vector("ViewLayer.Normal", normal()), "ViewLayer.Albedo": albedo()}
    images.exr(scene / "passes.exr", {**pictures, **planes, **geometry})
    said = ok("render", "passes.exr", "-o", "image", "--no-preview").err
    assert "holds a picture and a depth or positions, and is taken as an ideal image; --pattern IMAGE makes" in said
    of = {"depth": "z.npy"} if len(geometry) == 1 else {"position": "p.npy"}
    expected = rendered(ok, scene, *options(**of, normal="n.npy", albedo="a.npy"), *CAMERA)
    np.testing.assert_array_equal(rendered(ok, scene, "passes.exr", *CAMERA), expected)
    (scene / "sequence.json").write_text(json.dumps(sequence(frames=["passes.exr"])))
    arguments = [*CAMERA, "--f-number", 4, "--pixel-pitch", 3e-6, "--wavelength", 8.5e-7]
    np.testing.assert_array_equal(
        rendered(ok, scene, "sequence.json", *CAMERA), rendered(ok, scene, "passes.exr", *arguments)
    )


def test_a_picture_without_a_named_geometry_is_an_image(ok, refused, scene: Path) -> None:
    pictures = {f"ViewLayer.Combined.{name}": plane for name, plane in colors().items()}
    images.exr(scene / "mist.exr", {**pictures, "ViewLayer.Mist.Z": depth()})
    assert "depth" not in ok("render", "mist.exr", "-o", "mist", "--no-preview").err
    assert "is an ideal image, which takes no --pattern" in refused("render", "mist.exr", *ARGUMENTS)


def test_channel_is_of_an_ideal_image(refused, ok, scene: Path, expected: np.ndarray) -> None:
    images.exr(scene / "all.exr", BLENDER)
    message = refused("render", *options(depth="all.exr"), "--channel", "ViewLayer.Depth.Z", *ARGUMENTS)
    named = re.search(r"behind its file: --depth (\S+)", message)
    assert named
    np.testing.assert_array_equal(rendered(ok, scene, *options(depth=named[1], normal="all.exr"), *CAMERA), expected)


def test_layers_of_a_picture(ok, tmp_path: Path) -> None:
    images.exr(tmp_path / "layers.exr", {**BLENDER, **colors("ViewLayer.DiffCol.")})
    result = ok("render", "layers.exr", "-o", "out", "--save-ideal", "--no-preview")
    mean = np.mean([plane.astype(float) for plane in COLORS.values()], axis=0).astype(np.float32)
    np.testing.assert_array_equal(np.load(tmp_path / "out" / "ideal_000000.npy"), mean)
    assert "color channels differ" in result.err


WRITE = {
    "plane.png": lambda path, codes: iio.imwrite(path, codes.astype(np.uint8)),
    "plane.tiff": lambda path, codes: tifffile.imwrite(path, codes.astype(np.uint8), photometric="rgb"),
    "plane.npy": lambda path, codes: np.save(path, codes),
}


@pytest.mark.parametrize("name", WRITE)
def test_numbers_in_colors_are_refused_until_one_is_named(ok, refused, scene: Path, name: str) -> None:
    """Ids in three colors that differ have no mean."""
    ids = np.zeros((*depth().shape, 3))
    ids[:, 20:, 0] = 1
    ids[:, 30:, 1] = 4
    WRITE[name](scene / name, ids)
    np.save(scene / "ids.npy", ids[..., 0].astype(np.uint8))
    given = ["--depth", "z.npy", "--refresh-mask"]
    message = refused("render", *given, name, *ARGUMENTS)
    assert f"{name}: its 3 color channels differ" in message
    named = re.search(r"name: (\S+)$", message.strip())
    assert named and named[1] == f"{name}:R"
    np.testing.assert_array_equal(
        rendered(ok, scene, *given, named[1], *CAMERA),
        rendered(ok, scene, *given, "ids.npy", *CAMERA),
    )
    assert f'{name}: has no channel "Z"; its channels are: R, G, B' in refused(
        "render", *given, f"{name}:Z", *ARGUMENTS
    )
    WRITE[name](scene / name, np.repeat(ids[..., :1], 3, axis=-1))
    rendered(ok, scene, *given, name, *CAMERA)


@pytest.mark.parametrize("colors", [1, 3])
def test_a_sample_that_a_tiff_file_does_not_explain_is_no_opacity(ok, refused, scene: Path, colors: int) -> None:
    """As other programs save infrared and depth, or colors and infrared."""
    planes = [COLORS["R"]] * colors + [COLORS["B"]]
    kind = {"photometric": "rgb" if colors == 3 else "minisblack", "planarconfig": "contig"}
    tifffile.imwrite(scene / "two.tif", np.stack(planes, -1), extrasamples=[0], **kind)
    message = refused("render", "two.tif", "-o", "out")
    advised = re.search(r"does not say .*\. Name one behind the file's name: (\S+), or the last, (\S+)$", message)
    assert advised
    for name, plane in zip(advised.groups(), (COLORS["R"], COLORS["B"]), strict=True):
        assert ok("render", name, "-o", "out", "--save-ideal", "--no-preview").err == ""
        np.testing.assert_array_equal(np.load(scene / "out" / "ideal_000000.npy"), plane)
    # OpenCV says nothing of an opacity, which is full.
    tifffile.imwrite(scene / "two.tif", np.stack([*planes[:-1], np.ones_like(planes[0])], -1), extrasamples=[0], **kind)
    assert ok("render", "two.tif", "-o", "out", "--save-ideal", "--no-preview").err == ""
    np.testing.assert_array_equal(np.load(scene / "out" / "ideal_000000.npy"), COLORS["R"])
    tifffile.imwrite(scene / "two.tif", np.stack(planes, -1), extrasamples=[2], **kind)
    assert "opacity channel is ignored" in ok("render", "two.tif", "-o", "out").err


def test_a_fourth_number_of_vectors_is_left_out(ok, scene: Path) -> None:
    four = np.dstack([position(), np.zeros_like(depth())]).astype(np.float32)
    tifffile.imwrite(scene / "four.tif", four, photometric="rgb", extrasamples=[0])
    given, expected = (rendered(ok, scene, *options(position=name)) for name in ("four.tif", "p.npy"))
    np.testing.assert_array_equal(given, expected)


def test_masks_and_patterns_are_named_likewise(ok, refused, scene: Path) -> None:
    images.exr(scene / "all.exr", {"dots": albedo(), "mask": visibility(), "other": albedo()})
    np.save(scene / "mask.npy", visibility())
    given = ok("statistics", "a.npy", "--mask", "all.exr:mask", "--json").json()["frames"][0]["count"]
    assert given == ok("statistics", "a.npy", "--mask", "mask.npy", "--json").json()["frames"][0]["count"]
    one = ok("statistics", "all.exr:dots", "--json").json()["frames"][0]["mean"]
    assert one == ok("statistics", "a.npy", "--json").json()["frames"][0]["mean"]
    assert "Its channels are: dots, mask, other" in refused("statistics", "all.exr")
    arguments = [*CAMERA, *LASER, *PATTERN[2:]]
    ok(
        "render",
        "--depth",
        "z.npy",
        "--pattern",
        "all.exr:dots",
        "-o",
        "one",
        "--format",
        "npy",
        *arguments,
    )
    ok(
        "render",
        "--depth",
        "z.npy",
        "--pattern",
        "a.npy",
        "-o",
        "two",
        "--format",
        "npy",
        *arguments,
    )
    frames = [np.load(scene / folder / "frame_000000.npy") for folder in ("one", "two")]
    np.testing.assert_array_equal(*frames)


def test_a_colon_in_a_name_is_no_channel(ok, tmp_path: Path) -> None:
    images.exr(tmp_path / "at 12:30.exr", {"Y": images.real(), "Z": images.real()})
    ok("statistics", "at 12:30.exr")
    ok("statistics", "at 12:30.exr:Z")


def test_an_input_that_is_named_by_its_channel_is_not_overwritten(refused, tmp_path: Path) -> None:
    images.exr(tmp_path / "frame_000000.exr", colors())
    (tmp_path / "frame_000000.exr").rename(tmp_path / "frame_000000.npy")  # the content decides
    message = refused("render", "frame_000000.npy:R", "-o", ".", "--format", "npy", "--no-preview")
    assert "overwrite" in message


def test_a_picture_of_one_channel_beside_a_depth(ok, refused, scene: Path) -> None:
    """No name tells that IR is a picture: the message names it."""
    images.exr(scene / "frame.exr", {"IR": COLORS["R"], "Z": depth()})
    message = refused("render", "frame.exr", "-o", "out")
    assert "is a scene: name the projected pattern with --pattern IMAGE" in message
    advice = re.search(r"is the ideal image, that channel: (\S+)", message)
    assert advice and advice[1] == "frame.exr:IR"
    ok("render", advice[1], "-o", "out", "--save-ideal", "--no-preview")
    np.testing.assert_array_equal(np.load(scene / "out" / "ideal_000000.npy"), COLORS["R"])
    np.testing.assert_array_equal(
        rendered(ok, scene, "frame.exr", *CAMERA), rendered(ok, scene, "--depth", "z.npy", *CAMERA)
    )


def test_a_channel_of_all_files(ok, refused, tmp_path: Path) -> None:
    folder = tmp_path / "frames"
    folder.mkdir()
    for i in range(3):
        images.exr(folder / f"f{i}.exr", {"a": images.real() * (i + 1), "b": images.real()})
    for name in ("frames:a", "frames/f*.exr:a", "frames/f?.exr:a"):
        ok("render", name, "-o", name[-4:-2] + "out", "--save-ideal", "--no-preview")
        given = [np.load(path) for path in sorted((tmp_path / (name[-4:-2] + "out")).glob("ideal_*.npy"))]
        np.testing.assert_array_equal(given, [images.real() * (i + 1) for i in range(3)])
    assert len(ok("statistics", "frames:b", "--json").json()["frames"]) == 3
    assert 'has no channel "c"; its channels are: a, b' in refused("render", "frames:c", "-o", "none")
    assert "no file matches" in refused("render", "frames/g*.exr:a", "-o", "none")

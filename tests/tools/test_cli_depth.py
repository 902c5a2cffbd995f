"""The depth sub-command: from files of frames, dots and geometry to a table, CSV, NPY and pictures."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
from scipy import ndimage

from reference import depth as reference

RIG = reference.rig((200, 260), focal_px=240.0)
DIRECTIONS = reference.semi_random_directions((0.7, 0.55), 8 / RIG.fx, seed=5)
WALL_M = 1.0


@pytest.fixture(scope="module")
def frame() -> reference.Frame:
    return reference.render(RIG, [reference.plane(WALL_M)], DIRECTIONS, 1.2, scale=2000.0)


@pytest.fixture
def scene(tmp_path: Path, frame: reference.Frame) -> tuple[object, ...]:
    """Two frames of codes, the list of dots, the geometry; the arguments that name the latter two."""
    rng = np.random.default_rng(6)
    for index in range(2):
        noisy = frame.image + 64 + rng.normal(0, 2, frame.image.shape)
        iio.imwrite(tmp_path / f"frame_{index}.png", noisy.round().clip(0, 65535).astype(np.uint16))
    np.savetxt(tmp_path / "dots.txt", DIRECTIONS, header="x/z y/z")
    (tmp_path / "rig.json").write_text(json.dumps(geometry()))
    return ("--dots", "dots.txt", "--geometry", "rig.json", "--dot-sigma-px", 1.2, "--read-noise-dn", 2)


def geometry() -> dict:
    return {
        "camera": {"fx_px": RIG.fx, "fy_px": RIG.fy, "cx_px": RIG.cx, "cy_px": RIG.cy},
        "laser": {"laser_from_geometry": RIG.laser_from_camera.ravel().tolist()},
        "depth_range_m": [0.4, 4],
    }


LEFT, TOP = 110, 40  # margins of a picture


def check_pictures(folder: Path, number: int, dots: np.ndarray) -> None:
    """Dots stand where they are: green crosses where they have a depth, and in the depth's color in the map."""
    overlay = iio.imread(folder / f"overlay_{number:06}.png")
    colors = iio.imread(folder / f"depth_{number:06}.png")
    scale = 900 // max(RIG.shape)
    own = dots[dots["reason"] == 0]
    depth = own["depth_m"]
    shades = []
    for dot in own:
        x = LEFT + round((dot["x_px"] + 0.5) * scale)
        y = TOP + round((dot["y_px"] + 0.5) * scale)
        assert overlay.shape[2] == colors.shape[2] == 3
        assert tuple(overlay[y, x + 3]) == (80, 250, 123)
        shades.append(colors[y, x].astype(int))
    near, far = np.argmin(depth), np.argmax(depth)
    assert tuple(shades[near]) == (68, 1, 84) and tuple(shades[far]) == (253, 231, 37), "the ends of viridis"
    bar = colors[TOP : TOP + RIG.shape[0] * scale, LEFT + RIG.shape[1] * scale + 20 + 12].astype(int)
    np.testing.assert_allclose(bar[0], (253, 231, 37), atol=2)
    np.testing.assert_allclose(bar[-1], (68, 1, 84), atol=2)
    legend = overlay[TOP:, LEFT + RIG.shape[1] * scale + 20 :]
    assert np.any(np.all(legend == (80, 250, 123), axis=2)) and np.count_nonzero(np.all(legend == 0, axis=2)) > 500


def test_table_and_files(ok, tmp_path: Path, scene, frame: reference.Frame) -> None:
    out = ok("depth", "frame_*.png", *scene, "--csv", "dots.csv", "--npy", "dots.npy", "--pictures", "pictures").out
    assert out.splitlines()[0].split()[:3] == ["file", "dots", "placed"]
    assert "frame_0.png" in out and "frame_1.png" in out
    table = np.load(tmp_path / "dots.npy")
    rows = list(csv.DictReader((tmp_path / "dots.csv").open()))
    assert len(rows) == len(table) > 400
    assert set(table["frame"]) == {0, 1}
    for name in ("x_px", "depth_m", "epipolar_error_px", "dot_index", "reason"):
        np.testing.assert_array_equal(np.array([float(row[name]) for row in rows]), table[name])
    placed = table[table["reason"] == 0]
    assert all((row["reason_text"] == "placed") == (row["reason"] == "0") for row in rows)
    np.testing.assert_allclose(np.median(placed["depth_m"]), WALL_M, rtol=2e-3)
    index = placed["dot_index"].astype(int)
    clean = frame.visible[index]
    error = np.hypot(placed["x_px"] - frame.centres[index, 0], placed["y_px"] - frame.centres[index, 1])[clean]
    assert np.sqrt(np.mean(error**2)) < 0.02
    for number in range(2):
        check_pictures(tmp_path / "pictures", number, table[table["frame"] == number])
        depth = np.load(tmp_path / "pictures" / f"depth_{number:06}.npy")
        own = placed[placed["frame"] == number]
        pixels = np.rint(np.stack([own["y_px"], own["x_px"]], axis=1)).astype(int)
        inside = np.all((pixels >= 0) & (pixels < RIG.shape), axis=1)
        assert np.count_nonzero(np.isfinite(depth)) == len(np.unique(pixels[inside], axis=0))
        np.testing.assert_allclose(np.nanmedian(depth), np.median(own["depth_m"]), rtol=1e-3)


def test_json_and_npy_lists(ok, tmp_path: Path, scene) -> None:
    np.save(tmp_path / "dots.npy", DIRECTIONS.astype(np.float32))
    text = ok("depth", "frame_0.png", *scene, "--json").json()
    again = ok("depth", "frame_0.png", *scene, "--json", "--dots", "dots.npy").json()
    assert text["pattern_dots"] == len(DIRECTIONS)
    (one,), (other,) = text["frames"], again["frames"]
    assert one["placed_count"] == other["placed_count"] > 0.95 * one["fitted_count"]
    assert one["median_depth_m"] == pytest.approx(WALL_M, rel=2e-3)
    assert one["detected_dots"]["placed"] == one["placed_count"]
    assert sum(one["detected_dots"].values()) == one["detected_count"]
    assert sum(one["pattern_dots"].values()) == len(DIRECTIONS)
    assert one["median_epipolar_error_px"] < 3 * one["expected_epipolar_error_px"]
    assert one["warnings"] == []


def test_the_lens_of_the_geometry_file_tells_of_speckle(ok, refused, tmp_path: Path, scene) -> None:
    """sqrt(2) / pi C / D px along the line, in quadrature, whatever the noise; --relative-diameter goes before the
    file."""
    with_lens = geometry()
    with_lens["camera"] |= {"f_number": 2.8, "pixel_pitch_m": 2.9e-6}
    with_lens["laser"]["wavelength_m"] = 940e-9
    (tmp_path / "lens.json").write_text(json.dumps(with_lens))

    def deviation(*options: object) -> float:
        (one,) = ok("depth", "frame_0.png", *scene, *options, "--json").json()["frames"]
        return one["median_centre_sd_px"]

    bare = deviation()
    lens = deviation("--geometry", "lens.json", "--speckle-contrast", 0.7)
    assert lens == pytest.approx(np.hypot(bare, np.sqrt(2) / np.pi * 0.7 * 2.8 * 0.94 / 2.9), rel=0.05)
    diameter = 2.9 / (0.94 * 2.8)
    assert deviation("--relative-diameter", diameter, "--speckle-contrast", 0.7) == pytest.approx(lens, rel=1e-6)
    assert deviation("--geometry", "lens.json", "--relative-diameter", 0) == bare
    with_lens["camera"]["f_number"] = 0
    (tmp_path / "none.json").write_text(json.dumps(with_lens))
    assert "f_number" in refused("depth", "frame_0.png", *scene, "--geometry", "none.json")


def test_wrong_geometry_and_empty_frames_are_told(ok, tmp_path: Path, scene) -> None:
    wrong = geometry()
    pose = np.array(wrong["laser"]["laser_from_geometry"]).reshape(3, 4)
    turned = np.concatenate([reference.rotation((0, 0, 1), 0.06) @ pose[:, :3], pose[:, 3:]], axis=1)
    wrong["laser"]["laser_from_geometry"] = turned.ravel().tolist()
    (tmp_path / "wrong.json").write_text(json.dumps(wrong))
    run = ok("depth", "frame_0.png", *scene, "--geometry", "wrong.json")
    assert "check the geometry" in run.err
    assert "dots without a depth" in run.out
    iio.imwrite(tmp_path / "dark.png", np.full(RIG.shape, 64, np.uint16))
    run = ok("depth", "dark.png", *scene)
    assert "the frame has no dots" in run.err


def test_warnings_lead_to_frames_without_one(ok, tmp_path: Path, scene, frame: reference.Frame) -> None:
    """Each is provoked by a gross fault of the frame or the geometry, and gone without that."""
    blurred = ndimage.gaussian_filter(8 * frame.image, 3.0)
    twisted = geometry()
    pose = np.array(twisted["laser"]["laser_from_geometry"]).reshape(3, 4)
    turned = np.concatenate([reference.rotation((0, 0, 1), 0.004) @ pose[:, :3], pose[:, 3:]], axis=1)
    twisted["laser"]["laser_from_geometry"] = turned.ravel().tolist()
    (tmp_path / "twisted.json").write_text(json.dumps(twisted))
    top = ("--saturation-dn", 4095)
    good = ok("depth", "frame_0.png", *scene, *top).err
    for says, image, more in (
        ("the frame has no dots; check the exposure", 0 * frame.image, ()),
        ("more than a tenth of the dots are saturated; shorten the exposure", np.minimum(10 * frame.image, 4031), top),
        ("more than a fifth of the dots are merged; check dot_sigma_px and the focus", blurred, ()),
        ("depths err likewise; check laser_from_camera", frame.image, ("--geometry", "twisted.json")),
    ):
        iio.imwrite(tmp_path / "other.png", (image + 64).round().clip(0, 65535).astype(np.uint16))
        told = ok("depth", "other.png", *scene, *more).err
        assert says in told, (says, told)
        assert says not in good


def test_bad_input(refused, tmp_path: Path, scene) -> None:
    def write(name: str, text: str) -> str:
        (tmp_path / name).write_text(text)
        return name

    assert "line 2" in refused("depth", "frame_0.png", *scene, "--dots", write("a.txt", "1 2\n3 x\n"))
    assert "line 1" in refused("depth", "frame_0.png", *scene, "--dots", write("b.txt", "1 2 3\n"))
    assert "line 1" in refused("depth", "frame_0.png", *scene, "--dots", write("c.txt", "1 nan\n"))
    assert "no dots" in refused("depth", "frame_0.png", *scene, "--dots", write("d.txt", "# nothing\n"))
    np.save(tmp_path / "three.npy", np.zeros((5, 3), np.float32))
    assert "n rows of 2" in refused("depth", "frame_0.png", *scene, "--dots", "three.npy")
    assert "missing.txt" in refused("depth", "frame_0.png", *scene, "--dots", "missing.txt")
    for change, word in (
        (lambda g: g.pop("camera"), "camera"),
        (lambda g: g["camera"].pop("fx_px"), "camera.fx_px is missing"),
        (lambda g: g["camera"].update(cy_px="x"), "camera.cy_px"),
        (lambda g: g["laser"].pop("laser_from_geometry"), "laser_from_geometry is missing"),
        (lambda g: g["laser"].update(laser_from_geometry=[1, 2]), "12 numbers"),
        (lambda g: g["laser"].update(laser_from_geometry=[2.0] * 12), "not a rotation"),
        (lambda g: g["laser"].update(pattern={"projection": "fisheye"}), "tangent_plane"),
        (lambda g: g.update(depth_range_m=[4]), "depth_range_m"),
        (lambda g: g.update(depth_range_m=[4, 1]), "near_m"),
    ):
        changed = geometry()
        change(changed)
        message = refused("depth", "frame_0.png", *scene, "--geometry", write("bad.json", json.dumps(changed)))
        assert word in message
    assert "--near-m" in refused("depth", "frame_0.png", *scene, "--near-m", "nan")
    assert "--dot-sigma-px" in refused("depth", "frame_0.png", *scene, "--dot-sigma-px", 9)
    iio.imwrite(tmp_path / "small.png", np.zeros((6, 6), np.uint16))
    assert "need at least" in refused("depth", "small.png", *scene)
    assert "one size" in refused("depth", "frame_0.png", "small.png", *scene)
    bad = np.zeros(RIG.shape, np.float32)
    bad[3, 5] = np.nan
    np.save(tmp_path / "bad.npy", bad)
    assert "pixel (5, 3)" in refused("depth", "bad.npy", *scene, "--csv", "never.csv")
    assert "the same file" in refused("depth", "frame_0.png", *scene, "--csv", "out.npy", "--npy", "out.npy")
    assert "required" in refused("depth", "frame_0.png", "--dots", "dots.txt")
    refused("depth", "frame_0.png", *scene, "--csv", "no/folder/dots.csv", code=3)
    assert "the same file" in refused("depth", "frame_0.png", *scene, "--csv", "out.npy", "--npy", "./out.npy")
    refused("depth", "frame_0.png", *scene, "--csv", "", "--npy", "no/folder/dots.npy", code=3)
    (tmp_path / "file").write_text("mine")
    assert "with --pictures" in refused("depth", "frame_0.png", *scene, "--pictures", "file", code=3)
    assert "--max-dots" in refused("depth", "frame_0.png", *scene, "--max-dots", "-1")


def test_no_file_is_replaced_unasked(ok, refused, tmp_path: Path, scene) -> None:
    np.save(tmp_path / "frame.npy", iio.imread(tmp_path / "frame_0.png"))
    for output in (("--csv", "./rig.json"), ("--csv", "frame.npy"), ("--npy", "frame.npy"), ("--npy", "dots.txt")):
        message = refused("depth", "frame.npy:page=0", *scene, *output, "--overwrite")
        assert "overwrite the input" in message and output[0] in message
    options = ("--csv", "out.csv", "--npy", "out.npy", "--pictures", "pictures")
    ok("depth", "frame_0.png", *scene, *options)
    written = [tmp_path / "out.csv", tmp_path / "out.npy", *sorted((tmp_path / "pictures").iterdir())]
    assert len(written) == 5
    for path in written:
        path.write_text("mine")
    for option, name in zip(options[::2], options[1::2], strict=True):
        message = refused("depth", "frame_0.png", *scene, option, name, code=3)
        assert f"with {option}, or replace" in message and "--overwrite" in message
    assert all(path.read_text() == "mine" for path in written)
    ok("depth", "frame_0.png", *scene, "--csv", "other.csv", "--npy", "other.npy", "--pictures", "others")
    ok("depth", "frame_0.png", *scene, *options, "--overwrite")
    assert all(path.stat().st_size > 1000 for path in written)
    assert "--npy dots.png: the file is written as .npy" in refused("depth", "frame_0.png", *scene, "--npy", "dots.png")


def test_half_a_lens_is_told(ok, tmp_path: Path, scene) -> None:
    """Of pitch, f-number and wavelength all are needed; who knows it says so by --relative-diameter."""
    lens = {"f_number": 2.8, "pixel_pitch_m": 2.9e-6, "wavelength_m": 940e-9}
    for left_out in (("wavelength_m",), ("f_number",), ("pixel_pitch_m", "wavelength_m")):
        rig = geometry()
        for member, value in lens.items():
            if member not in left_out:
                rig["laser" if member == "wavelength_m" else "camera"][member] = value
        (tmp_path / "rig.json").write_text(json.dumps(rig))
        told = ok("depth", "frame_0.png", *scene).err
        assert all(f"no {'laser' if name == 'wavelength_m' else 'camera'}.{name}" in told for name in left_out)
        for diameter in (1.1, 0):
            assert "speckle" not in ok("depth", "frame_0.png", *scene, "--relative-diameter", diameter).err
    (tmp_path / "rig.json").write_text(json.dumps(geometry()))
    assert "speckle" not in ok("depth", "frame_0.png", *scene).err


def test_what_is_advised_is_taken(ok, refused, tmp_path: Path, scene) -> None:
    depth = ("depth", "frame_0.png", *scene)
    (tmp_path / "mine").mkdir()
    np.save(tmp_path / "mine" / "depth_000000.npy", iio.imread(tmp_path / "frame_0.png"))
    for bad, advice, good in (
        (
            ("--csv", "a.npy", "--npy", "a.npy"),
            "--csv and --npy name the same file",
            ("--csv", "a.csv", "--npy", "a.npy"),
        ),
        (("--pictures", ".", "--csv", "depth_9.npy"), "name another file", ("--pictures", "p", "--csv", "b.csv")),
        (
            ("mine/depth_000000.npy", "--pictures", "mine"),
            "name another folder",
            ("mine/depth_000000.npy", "--pictures", "q"),
        ),
        (("--npy", "dots.bin"), "written as .npy; choose a name that ends in it", ("--npy", "b.npy")),
    ):
        assert advice in refused(*depth, *bad)
        ok(*depth, *good)
    # What the help has, and what `doe layout` writes.
    (tmp_path / "none.json").write_text("{}")
    assert "see clspeckle depth --help" in refused(*depth, "--geometry", "none.json")
    text = ok("depth", "--help").out
    begin = text.index('{"camera"')
    end = text.index("\n", text.index("depth_range_m", begin))
    (tmp_path / "rig.json").write_text(text[begin:end])
    ok(*depth)
    assert "a layout of `clspeckle doe layout` or a design of" in refused(*depth, "--dots", "none.json")
    ok(
        "doe",
        "layout",
        "-o",
        "layout",
        "--size",
        96,
        "--pitch-um",
        1,
        "--field-of-view",
        "24,18",
        "--dots",
        60,
        "--min-difference",
        0,
    )
    ok(*depth, "--dots", "layout.json")


@pytest.mark.parametrize(
    ("diameter", "words"),
    [
        *[(value, "--relative-diameter: .* a number from 0 to 8") for value in (1e9, -1, "nan")],
        (1e-4, r"0 \(not known\) or 0.001 to 1000 cycles per pixel"),
    ],
)
def test_a_diameter_that_no_lens_has(refused, scene, diameter: object, words: str) -> None:
    assert re.search(words, refused("depth", "frame_0.png", *scene, f"--relative-diameter={diameter}"))


def test_inputs_outlive_the_pictures(refused, tmp_path: Path, scene, frame: reference.Frame) -> None:
    np.save(tmp_path / "depth_000000.npy", frame.image.astype(np.float32))
    message = refused("depth", "depth_000000.npy", *scene, "--pictures", ".")
    assert "is an input, which --pictures" in message
    message = refused("depth", "frame_0.png", *scene, "--pictures", ".", "--csv", "overlay_000000.png")
    assert "is a name that --pictures takes" in message


def test_lists_as_other_programs_write_them(ok, refused, tmp_path: Path, scene) -> None:
    lines = [f"{x:+.17e};{y:+.17e}\r\n" for x, y in DIRECTIONS]
    (tmp_path / "excel.txt").write_bytes(b"\xef\xbb\xbf" + "".join(lines).encode())
    plain = ok("depth", "frame_0.png", *scene, "--json").json()
    assert ok("depth", "frame_0.png", *scene, "--dots", "excel.txt", "--json").json()["frames"] == plain["frames"]
    for text in ("+-1 2\n", "1 +\n", "x" * 100000 + "\x07"):
        (tmp_path / "wrong.txt").write_text(text)
        message = refused("depth", "frame_0.png", *scene, "--dots", "wrong.txt")
        assert "line 1" in message
        assert len(message) < 300


def test_layouts_and_designs_are_lists_of_dots(ok, refused, tmp_path: Path, scene) -> None:
    """x/z and y/z from direction cosines; exact orders from a cell whose orders are 1e-3 apart."""
    orders = np.rint(DIRECTIONS / np.sqrt(1 + (DIRECTIONS**2).sum(axis=1, keepdims=True)) / 1e-3).astype(int)
    cosines = orders * 1e-3
    tangents = cosines / np.sqrt(1 - (cosines**2).sum(axis=1, keepdims=True))
    np.savetxt(tmp_path / "tangents.txt", tangents, fmt="%.17g")
    (tmp_path / "layout.json").write_text(json.dumps({"directions": cosines.tolist()}))
    about = {"orders": orders.tolist(), "wavelength_m": 1e-6, "pixel_pitch_m": 1e-6, "width": 1000, "height": 1000}
    (tmp_path / "design.json").write_text(json.dumps(about))
    expected = ok("depth", "frame_0.png", *scene, "--dots", "tangents.txt", "--json").json()
    assert expected["frames"][0]["placed_count"] > 300
    for name in ("layout.json", "design.json"):
        found = ok("depth", "frame_0.png", *scene, "--dots", name, "--json").json()["frames"][0]
        assert found["placed_count"] == expected["frames"][0]["placed_count"]
        assert found["median_depth_m"] == pytest.approx(expected["frames"][0]["median_depth_m"], rel=1e-6)
    by_cosines = geometry()
    by_cosines["laser"]["pattern"] = {"projection": "direction_cosines"}
    (tmp_path / "cosines.json").write_text(json.dumps(by_cosines))
    same = ok("depth", "frame_0.png", *scene, "--dots", "layout.json", "--geometry", "cosines.json", "--json").json()
    assert same["frames"][0]["placed_count"] == expected["frames"][0]["placed_count"]
    for text, word in (
        ("{}", "neither"),
        ('{"directions": [[0.8, 0.7]]}', "90 degrees"),
        ('{"directions": []}', "no dots"),
        ('{"orders": [[1, 2]]}', "pixel_pitch_m"),
        (json.dumps(about | {"width": 0}), '"width" is 0'),
    ):
        (tmp_path / "wrong.json").write_text(text)
        assert word in refused("depth", "frame_0.png", *scene, "--dots", "wrong.json")

"""Writes small files of every kind that is no image into FOLDER/KIND, for the fuzzers to begin with, and their words
into FOLDER/words.

make_file_seeds.py FOLDER
"""

from __future__ import annotations

import io
import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
CAPTURE = {
    "format": "clspeckle-capture",
    "version": 1,
    "camera": {"width": 192, "height": 160, "bits": 10, "pixel_pitch_um": 2.9, "f_number": 5.6, "black_level_dn": 64.0,
               "read_noise_dn": 4.0, "principal_point_px": [95.5, 79.5], "msb_aligned": False},
    "laser": {"wavelength_nm": 940.0, "degree_of_polarization": 0.5},
    "baseline": {"field": "unit_phasor"},
    "dots": {"sigma_px": 2.2, "positions_px": [[10.7, 11.2], [20, 30]]},
    "sequences": [
        {"name": "dark", "file": "dark.npy", "scene": "dark", "exposure_ms": 2.5},
        {"name": "board", "file": "b/*.png", "scene": "board", "motion": "moving", "f_number": 4, "mask": "mask.png"},
        {"name": "raw", "file": "r.raw", "scene": "dots", "motion": "static", "raw": "640x480,10,mipi"},
    ],
}  # fmt: skip
POSE = [1, 0, 0, 0.1, 0, 1, 0, 0, 0, 0, 1, 0]
SEQUENCE = {
    "format": "clspeckle-gbuffer-sequence",
    "version": 1,
    "frames": ["f.npy", "f.npy"],
    "frame_rate_hz": 30,
    "camera": {"fx_px": 30.0, "fy_px": 30.0, "cx_px": 15.5, "cy_px": 11.5, "depth_kind": "along_axis", "f_number": 4},
    "laser": {"wavelength_m": 940e-9, "laser_from_geometry": POSE, "pattern": {"file": "f.npy", "half_extent_x": 0.5}},
    "materials": [{"id": 1, "name": "wall", "roughness_rms_m": 1e-5, "living": True, "correlation_time_s": "inf"}],
    "moving_objects": [{"material_ids": [0, 1], "geometry_from_object": [POSE, POSE]}],
    "motion": {"rule": "off", "translate": True},
}
DESIGN = {"pixel_pitch_m": 1e-6, "wavelength_m": 940e-9, "periodic": True, "levels": 2, "width": 4, "height": 4}
HYPOTHESIS = {
    "id": "own", "stage": "optics", "summary": "more", "point": "intensity", "opencl": "f.cl",
    "parameters": {"slope": {"weak": 0.02, "strong": 0.2, "minimum": -1, "maximum": 1, "unit": "1"}},
}  # fmt: skip
MAP = {"file": "f.npy", "shape": [80, 96], "fnv1a": "0123456789abcdef", "holds": ["dsnu"], "sequences": ["dark"],
       "frames": 10, "pattern_kept": {"pixels": 0.9, "rows": 0, "columns": 1}}  # fmt: skip
PROFILE = {
    "format": "clspeckle-camera-profile",
    "version": 2,
    "camera": {"width": 96, "height": 80, "bits": 10, "pixel_pitch_m": 2.9e-6, "f_number": 5.6, "wavelength_m": 9.4e-7,
               "degree_of_polarization": 1.0, "field": "circular_gaussian", "principal_point_px": [47.5, 39.5],
               "black_level_dn": 63.5, "read_noise_dn": 3.0, "oversampling": 1, "fill_factor": 0.0},
    "effects": [{"effect": "dsnu", "parameters": {"sigma_dn": 2.0}, "intervals": {"sigma_dn": [1.9, 2.1]},
                 "named": True, "conditional": False}],
    "hypotheses": [{"effect": "own", "parameters": {"a": 2.0}, "intervals": {}, "named": False, "conditional": True}],
    "maps": {"dark": {**MAP, "standard_error_dn": 0.1}, "gain": {**MAP, "standard_error": 0.1}, "notes": ["none"]},
    "lab": {"sequences": [{"name": "dark", "scene": "dark", "moving": False, "f_number": 5.6, "exposure_ms": 1.5,
                           "mean_dn": 64, "light_dn": 0, "gain_dn": 0}],
            "lights": [{"light": "lamp", "sequences": ["flat"], "uneven": True, "slope": [0.1, 0], "corner_loss": 0.1}],
            "lamp_drifts": [{"sequence": "flat", "deviation": 0.01}], "lens_or_light": False},
    "provenance": {"capture": "set", "clspeckle": "0.1.0", "verdict": "named", "equivalent": [],
                   "residual_detected": False, "level": 0.05, "seed": 7},
}  # fmt: skip
SOURCES = [
    "#include <a>\n",
    "%:include\n",
    "#inc\\\nlude\n",
    "#/* */import\n",
    "??=embed\n",
    "__has_include(a)",
    "/*#*/\n#",
]
FILES: dict[str, list[Any]] = {
    "json": [[{}, [], "\u00e9", 1e3, -1, None, True, {"a": {"b": [1]}}]],
    "capture": [CAPTURE],
    "profile": [PROFILE],
    "tolerance": [{"quantities": {"temporal_noise": "0.2 DN", "flat/mean_signal": "1 %"}, "statistics": {"a/b/c": 1}}],
    "tuning": [],
    "configuration": [{"aperture": {"f_number": 8}, "render": {"format": "npy", "seed": 1, "frames": 2},
                       "effects": {"defocus": {"waves": 0.1}}, "lens": {"principal_point_px": [1, 2]}}],
    "sequence": [SEQUENCE],
    "dots": [CAPTURE["dots"], {"dots": CAPTURE["dots"]}],
    "geometry": [{**SEQUENCE, "depth_range_m": [0.5, 4]}],
    "design": [{**DESIGN, "orders": [[1, 2, 1.5], [0, 1]]},
               {**DESIGN, "periodic": False, "directions": [[0.1, 0.2, 1.5], [0, 0.1]]}],
    "hypothesis": [HYPOTHESIS],
}  # fmt: skip
KINDS = [*FILES, "directions", "source", "program", "pattern", "set"]


def a_set() -> dict[str, bytes]:
    """A capture set of 16 x 12 pixels: a stack, a series of pages with a mask, and pixels without a header."""
    rng = np.random.default_rng(1)
    codes = rng.integers(60, 70, (4, 12, 16), np.uint16)
    stack = io.BytesIO()
    np.save(stack, codes)
    camera = {**CAPTURE["camera"], "width": 16, "height": 12, "principal_point_px": [7.5, 5.5]}
    sequences = [
        {"name": "dark", "file": "dark.npy", "scene": "dark"},
        {"name": "flat", "file": "flat_*.pgm", "scene": "flat", "mask": "mask.pgm"},
        {"name": "board", "file": "board.raw", "scene": "board", "motion": "static", "raw": "16x12,16"},
    ]
    about = {key: value for key, value in CAPTURE.items() if key != "dots"}
    files = {
        "capture.json": json.dumps({**about, "camera": camera, "sequences": sequences}).encode(),
        "dark.npy": stack.getvalue(),
    }
    for number in range(2):
        files[f"flat_{number}.pgm"] = b"P5 16 12 1023\n" + (codes[number] + 200).astype(">u2").tobytes()
    files["mask.pgm"] = b"P5 16 12 255\n" + bytes([255] * 16 * 11 + [0] * 16)
    files["board.raw"] = (codes + 100).astype("<u2").tobytes()
    return files


def examples() -> list[str]:
    """What the docs show."""
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    return [block for page in pages for block in re.findall(r"```json\n(.*?)```", page.read_text(), re.S)]


def main(folder: Path) -> None:
    for kind, contents in FILES.items():
        target = folder / kind
        target.mkdir(parents=True, exist_ok=True)
        texts = [json.dumps(content, ensure_ascii=False) for content in contents] + examples()
        if kind == "tuning":
            texts += [path.read_text() for path in sorted((ROOT / "tuning").glob("*.json"))]
        for i, text in enumerate(texts):
            (target / f"{i:02}").write_text(text)
        (target / "mark").write_bytes(b"\xef\xbb\xbf" + texts[0].encode())
    for kind, texts in (("directions", ["0.1 0.2\n# a\n-1e-3,+2\n", "\ufeff1;2 # b\r\n\n"]), ("source", SOURCES)):
        (folder / kind).mkdir(exist_ok=True)
        for i, text in enumerate(texts):
            (folder / kind / str(i)).write_bytes(text.encode())
    (folder / "set").mkdir(exist_ok=True)
    whole = a_set()
    for name, names in (("whole", list(whole)), ("frames", [key for key in whole if key != "capture.json"])):
        (folder / "set" / name).write_bytes(b"\n".join(f"%%% {key}\n".encode() + whole[key] for key in names))
    # What the readers look for: from everything that is written and shown above.
    words = {word for kind in FILES for path in (folder / kind).iterdir()
             for word in re.findall(r'"([A-Za-z][\w/ .-]{1,40})"', path.read_text())}  # fmt: skip
    (folder / "words").write_text("".join(f'"\\"{word}\\""\n' for word in sorted(words)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))

"""Run by Blender: renders the passes of the open scene that G-buffers need, and writes what its camera and laser are.

    blender -b room.blend -noaudio -P examples/blender/render_passes.py -- --laser Laser --output passes

writes passes/passes.exr (multilayer: depth, normal, position, diffuse colour, material index, and the diffuse direct
light of the laser alone) and passes/view.json; passes_to_gbuffers.py makes a sequence of them. The scene needs a camera
and a point light where the laser stands; every other light and the world are switched off, the file is not saved. One
ray goes through the centre of each pixel.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent / "clspeckle_camera"))
from rendering import render_passes


def fail(message: str) -> None:
    print(f"render_passes: {message}", file=sys.stderr)
    sys.exit(1)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="blender ... -P render_passes.py --",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--output", type=Path, required=True, help="folder for passes.exr and view.json")
    parser.add_argument(
        "--laser", default="Laser", help="name of the point light that stands for the laser (default: Laser)"
    )
    own = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    return parser.parse_args(own)


def main() -> None:
    options = arguments()
    scene = bpy.context.scene
    laser = scene.objects.get(options.laser)
    if laser is None or laser.type != "LIGHT" or laser.data.type != "POINT":
        lights = ", ".join(o.name for o in scene.objects if o.type == "LIGHT" and o.data.type == "POINT") or "none"
        fail(
            f"there is no point light {options.laser!r}; point lights of this scene: {lights}; choose one with --laser"
        )
    options.output.mkdir(parents=True, exist_ok=True)
    about = options.output / "view.json"
    about.unlink(missing_ok=True)
    try:
        view = render_passes(scene, bpy.context.view_layer, laser, (options.output / "passes.exr").resolve())
    except RuntimeError as error:
        fail(str(error))
    part = about.with_name("view.json.part")
    part.write_text(json.dumps(view, indent=1) + "\n")
    part.replace(about)
    print(f"render_passes: {options.output / 'passes.exr'}, {about}")


main()

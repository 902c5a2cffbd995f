"""Arrows between files point one way: no new circle, no arrow to a folder above, no word of the C interface in the
engine."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "scripts" / "include_graph.py"
sys.path.insert(0, str(SCRIPT.parent))

import include_graph  # noqa: E402


def test_there_are_no_findings() -> None:
    found = include_graph.findings(ROOT)
    assert not found, "scripts/include_graph.py says what they mean:\n" + "\n".join(found)


def test_each_kind_is_found(tmp_path: Path) -> None:
    files = {
        "core/a.hpp": "",
        "core/a.cpp": '#include "a.hpp"\n#include "b.hpp"\n',
        "core/b.hpp": '#include "a.hpp"\nconst char *kText = "use CLSP_FORMAT_UINT8";\n',
        "core/runtime/low.hpp": '#include "a.hpp"\n',
        "core/fft/fft.hpp": '#include "stages/field.hpp"\n',
        "core/stages/field.hpp": "",
        "core/sound/ear.hpp": "",
        "diagnosis/capture/c.cpp": '#include "run/d.hpp"\n',
        "diagnosis/run/d.hpp": "",
        "diagnosis/report/e.cpp": '#include "run/d.hpp"\n',
        "validation/thesis/one.py": "def later():\n    from . import two\n",
        "validation/thesis/two.py": "from .one import later\n",
        "bindings/python/src/clspeckle/__init__.py": "from . import dataset\n",
        "bindings/python/src/clspeckle/_numbers.py": "from .dataset.shards import write\n",
        "bindings/python/src/clspeckle/dataset/__init__.py": "",
        "bindings/python/src/clspeckle/dataset/shards.py": "def write():\n    from .._numbers import one\n",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert include_graph.findings(tmp_path) == [
        "circle: core/a core/b",
        "circle: bindings/python/src/clspeckle/_numbers.py bindings/python/src/clspeckle/dataset/shards.py",
        "circle: validation/thesis/one.py validation/thesis/two.py",
        "arrow: core/fft/fft.hpp -> core/stages/field.hpp",
        "arrow: core/runtime/low.hpp -> core/a.hpp",
        "arrow: diagnosis/capture/c.cpp -> diagnosis/run/d.hpp",
        "arrow: diagnosis/report/e.cpp -> diagnosis/run/d.hpp",
        "room: core/sound",
        'C word: core/b.hpp: "use CLSP_FORMAT_UINT8"',
    ]
    done = subprocess.run([sys.executable, SCRIPT, "--root", tmp_path], check=False, capture_output=True, text=True)
    assert done.returncode == 1
    assert len(done.stdout.splitlines()) == 9

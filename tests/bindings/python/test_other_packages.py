"""Packages of others that read what is written here, and share memory with it, in an environment of their own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import clspeckle

PROGRAM = """
import jax
import jax.numpy as jnp
import numpy as np
import webdataset

import clspeckle
from clspeckle import dataset

ideal = np.random.default_rng(0).random((32, 48), np.float32)

# Shards, by the package whose form they have.
recipe = dataset.Recipe(scenes=[ideal], effects=["prnu", "defocus"], effects_per_image=(1, 2), seed=3)
shards = dataset.write(recipe, "set", count=10, shard_size=4)
pairs = dataset.Pairs("set")
samples = list(webdataset.WebDataset([str(shard) for shard in shards], shardshuffle=False).decode())
assert len(samples) == len(pairs) == 10
for sample, pair in zip(samples, pairs):
    assert sample["__key__"] == f"{pair.draw.index:09d}"
    assert np.array_equal(sample["codes.npy"], pair.codes)
    assert np.array_equal(sample["ideal.npy"], pair.ideal)
    assert dataset.Draw(**sample["json"]) == pair.draw

# JAX: an image of light and a frame of codes; what goes out is not copied on a CPU's context.
expected = clspeckle.simulate(ideal, seed=1)
assert np.array_equal(clspeckle.simulate(jnp.asarray(ideal), seed=1), expected)
image = clspeckle.DeviceImage.from_array(expected)
shared = jnp.from_dlpack(image)
assert np.array_equal(np.asarray(shared), expected)
device = next(d for d in clspeckle.devices() if d.usable)
if "cpu" in device.type:
    assert shared.unsafe_buffer_pointer() == np.asarray(image).ctypes.data
into = clspeckle.DeviceImage.from_dlpack(jnp.asarray(ideal))
assert np.array_equal(into.read(), ideal)
gradient = jax.grad(lambda light: (light**2).sum())(jnp.from_dlpack(into))
assert np.allclose(gradient, 2 * ideal)
print("read", len(samples), "pairs, JAX", jax.__version__)
"""


@pytest.mark.nightly
def test_webdataset_and_jax(tmp_path: Path) -> None:
    """The real packages: shards are WebDataset's, images are JAX's arrays. PyTorch from PyPI brings CUDA, of some
    gigabytes: tests/install/torch_pairs.py has Debian's."""
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "venv"], check=True, capture_output=True)
    python = tmp_path / "venv" / "bin" / "python"
    install = [str(python), "-m", "pip", "install", "-q", "--disable-pip-version-check", "webdataset", "jax", "numpy"]
    done = subprocess.run(install, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip("webdataset and JAX come from PyPI, which needs a network")
    (tmp_path / "program.py").write_text(PROGRAM, encoding="utf-8")
    package = Path(clspeckle.__file__).parent.parent
    environment = {**os.environ, "PYTHONPATH": str(package), "JAX_PLATFORMS": "cpu"}
    told = subprocess.run(
        [str(python), "program.py"], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert told.returncode == 0, told.stderr
    assert told.stdout.startswith("read 10 pairs, JAX ")

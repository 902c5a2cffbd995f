"""Training data: pairs of ideal and recorded images, each with a camera and effects of its own.

A :class:`Recipe` says what is drawn: scenes, cameras and effects with ranges. Pair `i` depends on the recipe and on `i`
alone, so that any pair, shard or part of a set can be made again, in any order and by any number of processes::

    recipe = clspeckle.dataset.Recipe(
        scenes=["wall.npy", "office.npy"],
        cameras=[{"f_number": [3.2, 8], "read_noise_dn": {"log": [1, 8]}, "bits": 10}],
        effects={"defocus": {"waves": [0.2, 0.8]}, "glare": {}, "prnu": {}},
        effects_per_image=(1, 3),
        seed=7,
    )
    clspeckle.dataset.write(recipe, "set", count=10000, workers=2)
    pairs = clspeckle.dataset.Pairs("set")  # for torch.utils.data.DataLoader, too

On the command line: ``python -m clspeckle.dataset recipe.json --out set --count 10000 --workers 2``.

Shards are WebDataset's: ``shard-000000.tar`` holds ``000000000.codes.npy``, ``000000000.ideal.npy`` and
``000000000.json`` for each pair. A shard is whole or it is not there; a stopped run goes on with what is missing, and
comes to the same bytes. With ``format="zarr"`` the set is a Zarr group (version 3) instead, of the arrays ``codes``,
``ideal`` and ``labels``. zarr-python 3 reads them all. Other readers read codes and ideal images where they know the
sharding codec; labels are strings, an extension of Zarr.
"""

from .recipe import Draw, Pair, Recipe
from .shards import Pairs, cluster, write

__all__ = ["Draw", "Pair", "Pairs", "Recipe", "cluster", "write"]

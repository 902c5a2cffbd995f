"""Debian's PyTorch beside the Debian package: its loader reads a set in processes of its own; tensors are shared."""

import numpy as np
import torch
from torch.utils.data import DataLoader

import clspeckle
from clspeckle import dataset


def tensors(pair: dataset.Pair) -> tuple[torch.Tensor, torch.Tensor]:
    return torch.from_numpy(pair.ideal), torch.from_numpy(pair.codes.astype(np.float32))


def main() -> None:
    ideal = np.random.default_rng(0).random((32, 48), np.float32)
    recipe = dataset.Recipe(scenes=[ideal], effects=["prnu", "defocus"], effects_per_image=(1, 2), seed=3)
    dataset.write(recipe, "pairs", count=10, shard_size=4)
    pairs = dataset.Pairs("pairs", transform=tensors)
    for processes in (0, 2):
        batches = list(DataLoader(pairs, batch_size=4, num_workers=processes))
        assert [len(batch[0]) for batch in batches] == [4, 4, 2]
        for index in range(10):
            scene, codes = (part[index % 4] for part in batches[index // 4])
            expected = recipe.render(index)
            assert np.array_equal(scene, expected.ideal)
            assert np.array_equal(codes, expected.codes)
    light, frame = torch.from_numpy(ideal.copy()), torch.zeros(32, 48)
    source, target = (clspeckle.DeviceImage.from_dlpack(tensor, copy=False) for tensor in (light, frame))
    assert torch.from_dlpack(source).data_ptr() == light.data_ptr() == np.asarray(source).ctypes.data
    camera = clspeckle.Pipeline.from_parameters((32, 48), seed=1, output="intensity")
    camera.enqueue_frame(source, target, frame_index=0, refresh="all").wait()
    assert np.array_equal(frame, camera.render(ideal, frame_index=0, refresh="all"))
    assert np.array_equal(frame, camera.render(light, frame_index=0, refresh="all"))
    print("PyTorch", torch.__version__, "reads", len(pairs), "pairs")


if __name__ == "__main__":
    main()

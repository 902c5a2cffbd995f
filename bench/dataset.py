#!/usr/bin/env python3
"""Training pairs a second, and where a pair's processor time goes.

Pairs of 640 x 480 pixels have a camera of their own (f-number, read noise, bits) and one to three random effects of all
that an image can have. First one process makes pairs, each several times: the first time builds programs, the fastest
of the others counts, by the processor time of all threads. Then whole sets are written to files, by the clock, in
rounds of which the median counts; programs that a worker must build first count. WORKERSxTHREADS names a run: 1x1 is
one worker whose PoCL has one thread, 2x1 two of them, 1 this process with all cores. What two processes on this machine
can gain at all is measured beside it, in the same rounds: each transforms images in NumPy, and they share nothing.
Processor time means more than the clock where other programs run beside it.

    .venv/bin/python bench/dataset.py --effects
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import statistics
import tarfile
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

import clspeckle
from clspeckle import dataset
from clspeckle.dataset import formats
from clspeckle.dataset import recipe as recipes
from clspeckle.pipeline import of_one_frame

CAMERA = {"f_number": [3.2, 8], "read_noise_dn": {"log": [1, 8]}, "bits": [8, 10], "exposure_gain_dn": 300}


def make_recipe(scene: Path, width: int, height: int) -> dataset.Recipe:
    y, x = np.mgrid[:height, :width]
    dots = np.exp(-(((x % 16 - 8) ** 2 + (y % 16 - 8) ** 2) / 8.0)) + 0.05
    np.save(scene, dots.astype(np.float32))
    effects = [effect.id for effect in clspeckle.effects() if "stages/dots.cl" not in effect.kernel]
    return dataset.Recipe(scenes=[scene], cameras=[CAMERA], effects=effects, effects_per_image=(1, 3), seed=1)


class Times:
    """Processor time in milliseconds, by what it was spent on."""

    def __init__(self) -> None:
        self.spent: dict[str, list[float]] = defaultdict(list)

    @contextmanager
    def of(self, name: str) -> Iterator[None]:
        begin = time.process_time()
        yield
        self.spent[name].append(1e3 * (time.process_time() - begin))


def one_by_one(recipe: dataset.Recipe, index: int, times: Times) -> None:
    """The effects of a pair, each in a call of its own."""
    drawn = recipe.draw(index)
    given = of_one_frame({**drawn.parameters, "seed": drawn.seed, "effects": drawn.effects})
    with clspeckle.Pipeline.from_parameters(recipe.ideal(drawn.scene).shape, **{**given, "effects": None}) as camera:
        with times.of("effects one by one"):
            for effect, values in drawn.effects.items():
                with times.of(f"effect {effect}"):
                    camera.set_effect(effect, **values)


def one_pair(recipe: dataset.Recipe, index: int, times: Times, shard: tarfile.TarFile) -> int:
    """A pair as :meth:`Recipe.render` and a shard make it, in parts. Returns how many programs were built."""
    context = clspeckle.default_context()
    before = context.info().programs_built
    with times.of("draw"):
        drawn = recipe.draw(index)
    with times.of("scene"):
        ideal = recipe.ideal(drawn.scene)
    with times.of("camera"):
        given = {**of_one_frame({**drawn.parameters, "seed": drawn.seed, "effects": drawn.effects}), "effects": None}
        camera = clspeckle.Pipeline.from_parameters(ideal.shape, context=context, **given)
    with times.of("effects"):
        camera.set_effects(drawn.effects)
    with times.of("frame"):
        codes = camera.render(ideal, frame_index=0, refresh="all")
    with times.of("close"):
        camera.close()
    with times.of("file"):
        formats._add(shard, "codes.npy", recipes.npy_bytes(codes))
        formats._add(shard, "ideal.npy", recipes.npy_bytes(ideal))
    return context.info().programs_built - before


def processor_seconds() -> float:
    """Of this process and its children that have ended."""
    both = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(use.ru_utime + use.ru_stime for use in both)


def transform(count: int) -> None:
    """About as long as `count` pairs, and no less memory."""
    image = np.ones((480, 640), np.complex64)
    for _ in range(count):
        image = np.fft.ifft2(np.fft.fft2(image)).astype(np.complex64)


def transforms_a_second(processes: int, count: int) -> float:
    spawn = multiprocessing.get_context("spawn")
    with spawn.Pool(processes) as pool:
        pool.map(transform, [1] * processes, 1)  # started, and NumPy is loaded
        begin = time.monotonic()
        pool.map(transform, [count // processes] * processes, 1)
        return count / (time.monotonic() - begin)


class Sets:
    """Sets that are written, in rounds."""

    def __init__(self, recipe: dataset.Recipe, folder: Path, count: int) -> None:
        self._recipe, self._folder, self._count = recipe, folder, count
        self.rates: dict[str, list[float]] = defaultdict(list)
        self.spent: dict[str, list[float]] = defaultdict(list)

    def write(self, run: str) -> None:
        workers, _, threads = run.partition("x")
        wall, processor = time.monotonic(), processor_seconds()
        with tempfile.TemporaryDirectory(dir=self._folder) as name:
            dataset.write(
                self._recipe,
                name,
                count=self._count,
                shard_size=max(1, self._count // 10),
                workers=int(workers),
                threads=int(threads) if threads else None,
            )
        self.rates[run].append(self._count / (time.monotonic() - wall))
        self.spent[run].append(1e3 * (processor_seconds() - processor) / self._count)

    def table(self) -> str:
        lines = ["| run | pairs a second | processor time of a pair, ms | to the first |", "|---|---|---|---|"]
        first = next(iter(self.rates.values()))
        for run, rates in self.rates.items():
            ratio = statistics.median(rate / one for rate, one in zip(rates, first, strict=True))
            spent = statistics.median(self.spent[run])
            lines.append(f"| {run} | {statistics.median(rates):.1f} | {spent:.1f} | {ratio:.2f} |")
        return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=100, help="that are timed in parts (default 100)")
    parser.add_argument("--set", type=int, default=400, help="pairs of a written set; 0: none (default 400)")
    parser.add_argument("--runs", nargs="*", default=["1x1", "2x1", "1"], help="of those sets (default 1x1 2x1 1)")
    parser.add_argument("--rounds", type=int, default=3, help="of those runs (default 3)")
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--height", type=int, default=480)
    parser.add_argument("--effects", action="store_true", help="also what each effect's set_effect() costs")
    parser.add_argument("--repeats", type=int, default=3, help="of which the fastest counts (default 3)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recipe = make_recipe(folder / "scene.npy", arguments.width, arguments.height)
        rows: dict[str, list[float]] = defaultdict(list)
        built = again = 0
        with (folder / "pairs.tar").open("wb") as file, formats._archive(file) as shard:
            for index in range(arguments.pairs):
                built += one_pair(recipe, index, Times(), shard)
                parts: dict[str, list[float]] = defaultdict(list)
                for _ in range(arguments.repeats):
                    times = Times()
                    with times.of("pair"):
                        again += one_pair(recipe, index, times, shard)
                    one_by_one(recipe, index, times)
                    for part, spent in times.spent.items():
                        parts[part].append(sum(spent))
                for part, spent in parts.items():
                    rows[part].append(min(spent))
        print(f"{arguments.pairs} pairs of {arguments.width} x {arguments.height}; "
              f"{built} programs were built, {again} in pairs made once more")  # fmt: skip
        print("\n| processor time of | mean, ms | median, ms | largest, ms |\n|---|---|---|---|")
        for part in [part for part in rows if not part.startswith("effect ")]:
            spent = rows[part]
            print(f"| {part} | {statistics.mean(spent):.2f} | {statistics.median(spent):.2f} | {max(spent):.2f} |")
        if arguments.effects:
            print("\n| set_effect() of | mean, ms | times |\n|---|---|---|")
            of_effects = [part for part in rows if part.startswith("effect ")]
            for part in sorted(of_effects, key=lambda part: -statistics.mean(rows[part])):
                print(f"| {part[7:]} | {statistics.mean(rows[part]):.2f} | {len(rows[part])} |")
        if not arguments.set:
            return
        sets, gains = Sets(recipe, folder, arguments.set), []
        for _ in range(arguments.rounds):
            gains.append(transforms_a_second(2, arguments.set) / transforms_a_second(1, arguments.set))
            for run in arguments.runs:
                sets.write(run)
        print(f"\n{arguments.set} pairs, {arguments.rounds} rounds\n\n{sets.table()}")
        print(f"\nTwo processes that share nothing do {statistics.median(gains):.2f} times as much as one.")


if __name__ == "__main__":
    main()

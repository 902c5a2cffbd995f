"""python -m clspeckle.dataset: writes a set."""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
import time
from collections.abc import Sequence
from types import FrameType
from typing import Any

from .. import errors
from .formats import FORMATS
from .recipe import Recipe
from .shards import cluster, write


def _arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m clspeckle.dataset",
        description="Writes pairs of ideal and recorded images in shards. A stopped run goes on.",
    )
    parser.add_argument("recipe", help="JSON file with scenes, cameras, effects, effects_per_image and seed")
    parser.add_argument("--out", required=True, help="folder of the set; made if it does not exist")
    parser.add_argument("--count", required=True, type=int, help="pairs")
    parser.add_argument("--shard-size", type=int, default=1000, help="pairs of a shard (default 1000)")
    parser.add_argument("--format", choices=list(FORMATS), default="webdataset", help="of shards (default webdataset)")
    parser.add_argument("--workers", type=int, help="processes (default 1, or one for each device)")
    parser.add_argument("--threads", type=int, help="of PoCL in each worker (default the cores divided by the workers)")
    parser.add_argument("--devices", help="of the workers in turn, separated by commas: 0:0,0:1 (default: the best)")
    parser.add_argument("--cluster", help="address of a scheduler of dask.distributed, whose workers do it")
    parser.add_argument("--no-ideal", action="store_true", help="leave the ideal images out of the shards")
    parser.add_argument("--quiet", action="store_true", help="print warnings and errors only")
    return parser.parse_args(argv)


def _devices(arguments: argparse.Namespace) -> Sequence[str]:
    if arguments.devices is None:
        return ()
    names = [name.strip() for name in arguments.devices.split(",")]
    if not all(names):
        raise TypeError(
            f'--devices is "{arguments.devices}", where a name is missing; give names with a comma between them, such '
            "as 0:0,0:1, or leave it out for the best device"
        )
    return names


def _check_cluster(arguments: argparse.Namespace) -> None:
    if not arguments.cluster.strip():
        raise TypeError("--cluster is empty; give the address that `dask scheduler` prints, such as tcp://HOST:8786")
    if arguments.workers is not None:
        raise TypeError("--workers is not for a cluster, which has its own; leave it out")
    if arguments.threads is not None:
        raise TypeError(
            "--threads is not for a cluster, whose workers run already; leave it out, and set POCL_MAX_PTHREAD_COUNT "
            "where each of them starts"
        )
    if arguments.devices is not None:
        raise TypeError(
            "--devices is not for a cluster, whose workers choose theirs; leave it out, and set CLSPECKLE_DEVICE "
            "where each of them starts"
        )


def main(argv: Sequence[str] | None = None) -> int:
    """What ``python -m clspeckle.dataset`` does; its exit code, as the program's."""
    arguments = _arguments(argv)
    begin: list[tuple[float, int]] = []
    signals: list[int] = []

    def interrupt(number: int, _frame: FrameType | None) -> None:
        signals.append(number)
        raise KeyboardInterrupt

    def progress(done: int, count: int) -> None:
        if signals:  # Python drops what is raised while an object is finalized
            raise KeyboardInterrupt
        if arguments.quiet:
            return
        begin.append((time.monotonic(), done))
        passed, fresh = begin[-1][0] - begin[0][0], done - begin[0][1]
        left = f", {passed / fresh * (count - done):.0f} s left" if fresh else ""
        print(f"{done} of {count} pairs{left}", file=sys.stderr, flush=True)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, interrupt)
    try:
        recipe = Recipe.from_file(arguments.recipe)
        with contextlib.ExitStack() as stack:
            by: dict[str, Any] = {"workers": arguments.workers, "threads": arguments.threads}
            devices = _devices(arguments)
            if arguments.cluster is not None:
                _check_cluster(arguments)
                by.update(stack.enter_context(cluster(arguments.cluster)))
            shards = write(
                recipe,
                arguments.out,
                count=arguments.count,
                shard_size=arguments.shard_size,
                with_ideal=not arguments.no_ideal,
                format=arguments.format,
                devices=devices,
                progress=progress,
                **by,
            )
    except KeyboardInterrupt:
        print("stopped; finished shards stay, the same command goes on", file=sys.stderr)
        return 130
    except (errors.InvalidArgumentError, TypeError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"error: {error}", file=sys.stderr)
        return 3
    except (errors.ClspeckleError, RuntimeError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if not arguments.quiet:
        print(f"{len(shards)} shards in {arguments.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

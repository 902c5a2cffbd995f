"""Pairs in files: shards that are whole or not there."""

from __future__ import annotations

import concurrent.futures
import contextlib
import errno
import fcntl
import json
import logging
import multiprocessing
import os
import socket
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Callable, Optional

from .. import _check, _json_file, errors
from .formats import FORMATS, shard_name, sweep, whole
from .recipe import Pair, Recipe

_log = logging.getLogger("clspeckle")

Progress = Callable[[int, int], Optional[bool]]
_DESCRIPTION = "dataset.json"
_LOCK = ".lock"
_PAIRS_END = 10**9
_CONNECT_SECONDS = 10
_WORKERS_OF_OTHERS = 16


def _lock(folder: Path) -> int:
    """The file that says that a run writes to the folder, open and locked. The lock ends with the process."""
    path = folder / _LOCK
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(file, 500, 0).decode(errors="replace") or "another run"
            os.close(file)
            raise BlockingIOError(
                errno.EWOULDBLOCK, f"{holder} writes to it; wait for its end, or name another folder", os.fspath(folder)
            ) from None
        except OSError as error:
            _log.warning("%s: its file system has no locks (%s); let no other run write there", folder, error)
            return file
        with contextlib.suppress(FileNotFoundError):
            # Else a run that has just ended took the file away between the two calls, and the lock is of no file.
            if os.path.samestat(os.fstat(file), path.stat()):
                return file
        os.close(file)


@contextlib.contextmanager
def _sole(folder: Path) -> Iterator[None]:
    """One run in a folder at a time."""
    file = _lock(folder)
    try:
        since = time.strftime("%Y-%m-%d %H:%M:%S")
        os.truncate(file, 0)
        os.pwrite(file, f"process {os.getpid()} of {socket.gethostname()}, since {since},".encode(), 0)
        yield
    finally:
        (folder / _LOCK).unlink(missing_ok=True)
        os.close(file)


def _write_shard(
    recipe: Recipe, folder: str, number: int, first: int, end: int, shard_size: int, with_ideal: bool, format: str
) -> int:
    """One shard, in whatever process; how many pairs it has."""
    with FORMATS[format].shard(Path(folder), number, shard_size, with_ideal) as add:
        for index in range(first, end):
            add(recipe.render(index))
    return end - first


def _begin_worker(threads: int, devices: Sequence[str], begun: Any) -> None:
    """In a worker, before it loads a driver: PoCL takes all cores in each process unless told, and the best device is
    the same for all of them. Where it pins threads to cores, every process begins with the first one."""
    if devices:
        with begun.get_lock():
            os.environ["CLSPECKLE_DEVICE"] = devices[begun.value % len(devices)]
            begun.value += 1
    parent = multiprocessing.parent_process()
    if parent is not None:

        def end_with_it() -> None:
            parent.join()
            os._exit(1)  # nobody waits for what this worker does

        threading.Thread(target=end_with_it, daemon=True).start()
    os.environ.update(POCL_MAX_PTHREAD_COUNT=str(threads), POCL_AFFINITY="0")


class _Processes:
    """Workers of this machine, not yet started."""

    def __init__(self, workers: int, threads: int | None, devices: Sequence[str]) -> None:
        if threads is None:
            told = os.environ.get("POCL_MAX_PTHREAD_COUNT", "")
            threads = int(told) if told.isdecimal() else max(1, len(os.sched_getaffinity(0)) // workers)
        self._workers, self._threads, self._devices = workers, threads, tuple(devices)

    def start(self) -> concurrent.futures.Executor:
        spawn = multiprocessing.get_context("spawn")
        told = self._threads, self._devices, spawn.Value("l", 0)
        return concurrent.futures.ProcessPoolExecutor(self._workers, spawn, _begin_worker, told)


@contextlib.contextmanager
def cluster(address: str) -> Iterator[dict[str, Any]]:
    """A cluster of ``dask.distributed`` that runs, as the arguments `executor` and `workers` of :func:`write`.

    Args:
        address: "tcp://HOST:PORT", as ``dask scheduler`` prints it. Its workers need clspeckle and see the folder.

    Raises:
        RuntimeError: the package `distributed` is missing, no scheduler is at the address, or it has no workers.
    """
    try:
        import distributed  # type: ignore[import-not-found,unused-ignore]
    except ImportError:
        raise RuntimeError(
            "a cluster needs the package distributed, which is not there; pip install distributed"
        ) from None
    try:
        of_dask: Any = distributed  # has no types of its own
        if not address.startswith("inproc://"):  # a Client that cannot read its address hangs when it is gone
            of_dask.comm.get_address_host_port(address)
        client = of_dask.Client(address, timeout=_CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError) as error:
        raise RuntimeError(
            f"{address}: no scheduler of a cluster answers ({error}); start one with `dask scheduler`, and name the "
            "address that it prints"
        ) from None
    with client:
        threads = sum(client.nthreads().values())
        if threads == 0:
            raise RuntimeError(f"{address}: the cluster has no workers; start some with `dask worker {address}`")
        yield {"executor": client.get_executor(), "workers": threads}


def _describe(recipe: Recipe, folder: Path, count: int, shard_size: int, with_ideal: bool, format: str) -> None:
    wanted: dict[str, Any] = {
        "format": "clspeckle-dataset",
        "version": 1,
        "count": count,
        "shard_size": shard_size,
        "with_ideal": with_ideal,
        "recipe": recipe.described(),
    }
    if format != "webdataset":
        wanted["shard_format"] = format
    path = folder / _DESCRIPTION
    if path.exists() and any(known.any_shard(folder) for known in FORMATS.values()):
        there = _description(folder)
        keys = {**wanted, **there}
        other = [key for key in keys if key != "count" and there.get(key) != wanted.get(key)]
        if other:
            raise errors.InvalidArgumentError(
                f"{folder} holds another set: its {', '.join(other)} differ; name another folder, or empty it"
            )
        if count < there["count"]:
            raise errors.InvalidArgumentError(
                f"{folder} holds a set of {there['count']} pairs, more than {count}; give that count or a larger one, "
                "or name another folder"
            )
        if count == there["count"]:
            return
        if there["count"] % shard_size:
            # Its last shard has fewer pairs than it shall have. Gone before the description says that it has them.
            for last in FORMATS[format].files(folder, there["count"] // shard_size, with_ideal):
                last.unlink(missing_ok=True)
    FORMATS[format].begin(folder, recipe, count, shard_size, with_ideal)
    with whole(path) as file:
        file.write((json.dumps(wanted, indent=1) + "\n").encode())


def _description(folder: Path) -> dict[str, Any]:
    path = folder / _DESCRIPTION
    try:
        given = _json_file.read_json(path)
    except (OSError, ValueError) as error:
        raise errors.InvalidArgumentError(f"{path}: {error}; expected what clspeckle.dataset.write() makes") from None
    if (
        not isinstance(given, dict)
        or given.get("format") != "clspeckle-dataset"
        or given.get("version") != 1
        or given.get("shard_format", "webdataset") not in list(FORMATS)
        or type(given.get("with_ideal")) is not bool
        or not isinstance(given.get("recipe"), dict)
        or not all(type(given.get(key)) is int and given[key] > 0 for key in ("count", "shard_size"))
        or given["count"] >= _PAIRS_END
    ):
        raise errors.InvalidArgumentError(f"{path}: is no description of a set that this version reads")
    return given


def write(
    recipe: Recipe,
    folder: str | os.PathLike[str],
    *,
    count: int,
    shard_size: int = 1000,
    with_ideal: bool = True,
    format: str = "webdataset",
    workers: int | None = None,
    threads: int | None = None,
    devices: Sequence[str] = (),
    executor: Any = None,
    progress: Progress | None = None,
) -> list[Path]:
    """Writes pairs 0 to count - 1 of a recipe in shards. Shards that are there stay as they are.

    A larger count than that of the set in the folder goes on with it, and comes to what one run of it makes.

    Args:
        recipe: what is drawn.
        folder: made if it does not exist; of this set alone.
        count: pairs, below 10^9.
        shard_size: pairs of a shard, at least 1, of Zarr at most 10^6; the last may have fewer.
        with_ideal: whether shards hold the scenes, too; else the labels name them.
        format: "webdataset": an archive each; "zarr": of the arrays `codes` (count, height, width) uint16, `ideal`
            likewise float32, and `labels` (count,), texts of JSON, of a Zarr group (version 3). Zarr needs scenes of
            one size; a shard that is not there yet reads as zeros.
        workers: processes; 1 without devices and threads: this one. None: one for each device, or 1. With an executor
            how many workers that has, so that none waits for work; None: 16.
        threads: of PoCL in each of these processes; None: what ``POCL_MAX_PTHREAD_COUNT`` says, else the cores divided
            by the workers. Other drivers have rules of their own.
        devices: of the workers in turn, each as ``CLSPECKLE_DEVICE`` names it, for example ``["0:0", "0:1"]``; none:
            each takes the best.
        executor: in place of processes of its own: a ``concurrent.futures.Executor``, for example a thread pool, or
            ``client.get_executor()`` of a ``dask.distributed.Client``, whose workers must see `folder`.
        progress: told pairs that are done and all of them after each shard; returning False ends the work.

    Returns:
        The shards, in order, of Zarr their `codes`; where `progress` ended the work, those that there are.

    Raises:
        InvalidArgumentError: see :class:`Recipe`; or the folder holds another set, or a larger one.
        BlockingIOError: another call writes to the folder; the message says which.
        OSError: the folder cannot be written, or is full. Finished shards stay, half ones are removed.
        RuntimeError: a worker died. Finished shards stay; the next call goes on.

    Threads: one call to a folder at a time, others are refused; different folders at the same time.
    """
    if not isinstance(recipe, Recipe):
        raise TypeError(f"recipe must be a clspeckle.dataset.Recipe, got {_check.kind(recipe)}")
    count = _check.integer(count, "count", 32)
    shard_size = _check.integer(shard_size, "shard_size", 32)
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise TypeError(f"executor must be a concurrent.futures.Executor, got {_check.kind(executor)}")
    if progress is not None and not callable(progress):
        raise TypeError(f"progress must be a function of two numbers, got {_check.kind(progress)}")
    if isinstance(devices, str) or not all(isinstance(device, str) and device for device in devices):
        raise TypeError(f'devices must be a list of names, such as ["0:0", "0:1"], got {_check.kind(devices)}')
    if executor is not None and devices:
        raise TypeError(
            "devices are not for an executor, which has workers of its own; leave them out, and set CLSPECKLE_DEVICE "
            "where each of those workers starts"
        )
    if executor is not None and threads is not None:
        raise TypeError(
            "threads are not for an executor, which has workers of its own; leave them out, and set "
            "POCL_MAX_PTHREAD_COUNT where each of those workers starts"
        )
    if workers is None:
        workers = len(devices) or (1 if executor is None else _WORKERS_OF_OTHERS)
    workers = _check.integer(workers, "workers", 16)
    if threads is not None and _check.integer(threads, "threads", 16) == 0:
        raise errors.InvalidArgumentError("threads is 0; expected at least 1, or None for a share of the cores")
    with_ideal = bool(_check.flag(with_ideal, "with_ideal"))
    if not 0 < count < _PAIRS_END or shard_size == 0 or workers == 0:
        raise errors.InvalidArgumentError(
            f"count is {count}, shard_size {shard_size}, workers {workers}; expected at least 1 of each, and fewer "
            "than 10^9 pairs"
        )
    _check.choice(format, "format", dict.fromkeys(FORMATS, 0))
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise NotADirectoryError(
            error.errno, "a set is a folder of its own, and a file has that name; name another one", os.fspath(target)
        ) from None
    with _sole(target):
        if executor is None and (workers > 1 or devices or threads is not None):
            executor = _Processes(workers, threads, devices)
        return _write_missing(recipe, target, count, shard_size, with_ideal, format, workers, executor, progress)


def _write_missing(
    recipe: Recipe,
    target: Path,
    count: int,
    shard_size: int,
    with_ideal: bool,
    format: str,
    workers: int,
    executor: Any,
    progress: Progress | None,
) -> list[Path]:
    _describe(recipe, target, count, shard_size, with_ideal, format)
    sweep(target)
    firsts = range(0, count, shard_size)
    shards = [FORMATS[format].files(target, number, with_ideal) for number in range(len(firsts))]

    def present() -> list[Path]:
        return [files[0] for files in shards if all(path.exists() for path in files)]

    missing = [number for number, files in enumerate(shards) if not all(path.exists() for path in files)]
    folder = os.fspath(target.absolute())
    tasks = [
        (recipe, folder, n, firsts[n], min(firsts[n] + shard_size, count), shard_size, with_ideal, format)
        for n in missing
    ]
    done = count - sum(end - first for _, _, _, first, end, *_ in tasks)
    if progress is not None and progress(done, count) is False:
        return present()
    for pairs in _run(tasks, workers, executor):
        done += pairs
        if progress is not None and progress(done, count) is False:
            break
    else:
        sweep(target)
    return present()


def _run(tasks: list[Any], workers: int, executor: Any) -> Iterator[int]:
    """Numbers of pairs as shards get done."""
    if not tasks:
        return
    if executor is None:
        for task in tasks:
            yield _write_shard(*task)
        return
    with contextlib.ExitStack() as stack:
        if isinstance(executor, _Processes):
            executor = stack.enter_context(executor.start())
        waiting = iter(tasks)
        running: dict[Any, str] = {}
        try:
            while True:
                # A few at a time: a stop leaves little to wait for, and few copies of a recipe are on their way.
                for task in waiting:
                    running[executor.submit(_write_shard, *task)] = shard_name(task[2])
                    if len(running) >= 2 * workers + 2:
                        break
                if not running:
                    return
                finished, _ = concurrent.futures.wait(running, return_when=concurrent.futures.FIRST_COMPLETED)
                for future in finished:
                    name = running.pop(future)
                    try:
                        pairs = future.result()
                    except (OSError, errors.ClspeckleError):
                        raise
                    except Exception as error:
                        raise RuntimeError(
                            f"a worker ended while it wrote {name}: {error}; finished shards stay, "
                            "the next call goes on"
                        ) from error
                    yield pairs
        finally:
            for future in running:
                future.cancel()


class Pairs(Sequence[Any]):
    """The pairs of a set that :func:`write` made, in order: a map-style dataset for ``torch.utils.data.DataLoader``.

    Args:
        folder: the set.
        scenes: for a set without ideal images: the recipe, whose scenes they are.
        transform: of each :class:`Pair`, for example to tensors; None: the pair itself. Processes of a DataLoader
            need one that can be pickled.

    Raises:
        InvalidArgumentError: no such set, or shards are missing.

    Threads: one thread at a time; may be pickled, and used after fork().
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        *,
        scenes: Recipe | None = None,
        transform: Callable[[Pair], Any] | None = None,
    ) -> None:
        self.folder = Path(folder)
        self.description = _description(self.folder)
        self.transform = transform
        self._scenes = scenes
        if scenes is None and not self.description["with_ideal"]:
            raise errors.InvalidArgumentError(f"{folder} holds no ideal images; give the recipe as scenes")
        if scenes is not None and scenes.described()["scenes"] != self.description["recipe"]["scenes"]:
            raise errors.InvalidArgumentError(f"scenes are not those of {folder}; give the recipe it was made of")
        size, with_ideal = self.description["shard_size"], self.description["with_ideal"]
        form = FORMATS[self.description.get("shard_format", "webdataset")]
        count = -(-self.description["count"] // size)
        shards = [form.files(self.folder, number, with_ideal) for number in range(count)]
        missing = [number for number, files in enumerate(shards) if not all(path.is_file() for path in files)]
        if missing:
            raise errors.InvalidArgumentError(
                f"{folder} is not whole: {len(missing)} of {count} shards are missing, the first is "
                f"{shard_name(missing[0])}; clspeckle.dataset.write() goes on with them"
            )
        self._reader = form.reader(self.folder, self.description)

    def __len__(self) -> int:
        return int(self.description["count"])

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        place = index + len(self) if index < 0 else index
        if not 0 <= place < len(self):
            raise IndexError(f"pair {index} of a set of {len(self)}")
        draw, codes, ideal = self._reader.load(place)
        if self._scenes is not None or ideal is None:
            assert self._scenes is not None
            ideal = self._scenes.ideal(draw.scene)
        pair = Pair(ideal, codes, draw)
        return pair if self.transform is None else self.transform(pair)

"""Pairs in files: shards that are whole or not there."""

from __future__ import annotations

import concurrent.futures
import contextlib
import dataclasses
import errno
import fcntl
import io
import json
import logging
import multiprocessing
import os
import secrets
import socket
import tarfile
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Callable, Optional

import numpy as np

from .. import _check, errors
from .recipe import Draw, Pair, Recipe, npy_bytes

_log = logging.getLogger("clspeckle")

Progress = Callable[[int, int], Optional[bool]]
_DESCRIPTION = "dataset.json"
_LOCK = ".lock"


def _shard_name(number: int) -> str:
    return f"shard-{number:06d}.tar"


def _add(archive: tarfile.TarFile, name: str, data: bytes) -> None:
    info = tarfile.TarInfo(name)  # no time, no user: the same bytes each time
    info.size = len(data)
    info.mode = 0o644
    archive.addfile(info, io.BytesIO(data))


@contextlib.contextmanager
def _whole(path: Path) -> Iterator[Any]:
    """A file that is written elsewhere, and gets its name when it is whole."""
    part = path.with_name(f".{path.name}.{secrets.token_hex(8)}.part")
    try:
        with open(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666), "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())  # else a power cut may leave the name without the bytes
        os.replace(part, path)
    except BaseException as error:
        with contextlib.suppress(OSError):
            os.unlink(part)
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise OSError(
                error.errno,
                f"there is no space left for {path.name}; finished shards stay: make room and call again",
                os.fspath(path.parent),
            ) from error
        raise


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


def _sweep(folder: Path) -> None:
    """Takes away what killed workers left."""
    for part in folder.glob(".*.part"):
        part.unlink(missing_ok=True)


def _write_shard(recipe: Recipe, path: str, first: int, end: int, with_ideal: bool) -> int:
    """One shard, in whatever process; how many pairs it has."""
    with _whole(Path(path)) as file, tarfile.open(fileobj=file, mode="w", format=tarfile.USTAR_FORMAT) as archive:
        for index in range(first, end):
            pair = recipe.render(index)
            key = f"{index:09d}"
            _add(archive, f"{key}.codes.npy", npy_bytes(pair.codes))
            if with_ideal:
                _add(archive, f"{key}.ideal.npy", npy_bytes(pair.ideal))
            _add(archive, f"{key}.json", (json.dumps(dataclasses.asdict(pair.draw)) + "\n").encode())
    return end - first


def _begin_worker(workers: int) -> None:
    """In a worker, before it loads a driver: PoCL takes all cores in each process unless told."""
    parent = multiprocessing.parent_process()
    if parent is not None:

        def end_with_it() -> None:
            parent.join()
            os._exit(1)  # nobody waits for what this worker does

        threading.Thread(target=end_with_it, daemon=True).start()
    os.environ.setdefault("POCL_MAX_PTHREAD_COUNT", str(max(1, len(os.sched_getaffinity(0)) // workers)))


def _describe(recipe: Recipe, folder: Path, count: int, shard_size: int, with_ideal: bool) -> None:
    wanted = {
        "format": "clspeckle-dataset",
        "version": 1,
        "count": count,
        "shard_size": shard_size,
        "with_ideal": with_ideal,
        "recipe": recipe.described(),
    }
    path = folder / _DESCRIPTION
    if path.exists() and any(folder.glob("shard-*.tar")):
        there = _description(folder)
        other = [key for key in wanted if key != "count" and there.get(key) != wanted[key]]
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
            (folder / _shard_name(there["count"] // shard_size)).unlink(missing_ok=True)
    with _whole(path) as file:
        file.write((json.dumps(wanted, indent=1) + "\n").encode())


def _description(folder: Path) -> dict[str, Any]:
    path = folder / _DESCRIPTION
    try:
        given = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise errors.InvalidArgumentError(f"{path}: {error}; expected what clspeckle.dataset.write() makes") from None
    if not isinstance(given, dict) or given.get("format") != "clspeckle-dataset" or given.get("version") != 1:
        raise errors.InvalidArgumentError(f"{path}: is no description of a set that this version reads")
    return given


def write(
    recipe: Recipe,
    folder: str | os.PathLike[str],
    *,
    count: int,
    shard_size: int = 1000,
    with_ideal: bool = True,
    workers: int = 1,
    executor: Any = None,
    progress: Progress | None = None,
) -> list[Path]:
    """Writes pairs 0 to count - 1 of a recipe as WebDataset shards. Shards that are there stay as they are.

    A larger count than that of the set in the folder goes on with it, and comes to what one run of it makes.

    Args:
        recipe: what is drawn.
        folder: made if it does not exist; of this set alone.
        count: pairs, below 10^9.
        shard_size: pairs of a shard, at least 1; the last may have fewer.
        with_ideal: whether shards hold the scenes, too; else the labels name them.
        workers: processes, each with its share of the cores; 1: this one.
        executor: in place of `workers`: a ``concurrent.futures.Executor``, for example a thread pool, or
            ``client.get_executor()`` of a ``dask.distributed.Client``, whose workers must see `folder`.
        progress: told pairs that are done and all of them after each shard; returning False ends the work.

    Returns:
        The shards, in order; where `progress` ended the work, those that there are.

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
    workers = _check.integer(workers, "workers", 16)
    if not 0 < count < 10**9 or shard_size == 0 or workers == 0:
        raise errors.InvalidArgumentError(
            f"count is {count}, shard_size {shard_size}, workers {workers}; expected at least 1 of each, and fewer "
            "than 10^9 pairs"
        )
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    with _sole(target):
        return _write_missing(recipe, target, count, shard_size, with_ideal, workers, executor, progress)


def _write_missing(
    recipe: Recipe,
    target: Path,
    count: int,
    shard_size: int,
    with_ideal: bool,
    workers: int,
    executor: Any,
    progress: Progress | None,
) -> list[Path]:
    _describe(recipe, target, count, shard_size, with_ideal)
    _sweep(target)
    firsts = range(0, count, shard_size)
    paths = [target / _shard_name(number) for number in range(len(firsts))]
    missing = [number for number, path in enumerate(paths) if not path.exists()]
    tasks = [
        (
            recipe,
            os.fspath(paths[number].absolute()),
            firsts[number],
            min(firsts[number] + shard_size, count),
            with_ideal,
        )
        for number in missing
    ]
    done = count - sum(end - first for _, _, first, end, _ in tasks)
    if progress is not None and progress(done, count) is False:
        return [path for path in paths if path.exists()]
    for pairs in _run(tasks, workers, executor):
        done += pairs
        if progress is not None and progress(done, count) is False:
            break
    else:
        _sweep(target)
    return [path for path in paths if path.exists()]


def _run(tasks: list[Any], workers: int, executor: Any) -> Iterator[int]:
    """Numbers of pairs as shards get done."""
    if not tasks:
        return
    if executor is None and workers == 1:
        for task in tasks:
            yield _write_shard(*task)
        return
    with contextlib.ExitStack() as stack:
        if executor is None:
            executor = stack.enter_context(
                concurrent.futures.ProcessPoolExecutor(
                    workers, multiprocessing.get_context("spawn"), _begin_worker, (workers,)
                )
            )
        waiting = iter(tasks)
        running: dict[Any, str] = {}
        try:
            while True:
                # A few at a time: a stop leaves little to wait for, and few copies of a recipe are on their way.
                for task in waiting:
                    running[executor.submit(_write_shard, *task)] = Path(task[1]).name
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
        size = self.description["shard_size"]
        names = [_shard_name(number) for number in range(-(-self.description["count"] // size))]
        missing = [name for name in names if not (self.folder / name).is_file()]
        if missing:
            raise errors.InvalidArgumentError(
                f"{folder} is not whole: {len(missing)} of {len(names)} shards are missing, the first is {missing[0]}; "
                "clspeckle.dataset.write() goes on with them"
            )
        self._offsets: dict[int, dict[str, tuple[int, int]]] = {}

    def __len__(self) -> int:
        return int(self.description["count"])

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        place = index + len(self) if index < 0 else index
        if not 0 <= place < len(self):
            raise IndexError(f"pair {index} of a set of {len(self)}")
        number = place // self.description["shard_size"]
        path = self.folder / _shard_name(number)
        if number not in self._offsets:
            with tarfile.open(path) as archive:
                self._offsets[number] = {m.name: (m.offset_data, m.size) for m in archive}
        members = self._offsets[number]

        def load(ending: str) -> bytes:
            offset, size = members[f"{place:09d}.{ending}"]
            file.seek(offset)
            return file.read(size)

        with path.open("rb") as file:
            draw = Draw(**json.loads(load("json")))
            codes = np.load(io.BytesIO(load("codes.npy")), allow_pickle=False)
            if self._scenes is None:
                ideal = np.load(io.BytesIO(load("ideal.npy")), allow_pickle=False)
            else:
                ideal = self._scenes.ideal(draw.scene)
        pair = Pair(ideal, codes, draw)
        return pair if self.transform is None else self.transform(pair)

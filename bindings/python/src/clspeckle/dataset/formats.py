"""What shards are in files: WebDataset's archives, or arrays of a Zarr group. A file is whole or it is not there."""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import io
import json
import os
import secrets
import struct
import tarfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, Callable, Protocol

import numpy as np
import numpy.typing as npt

from .. import _json_file, errors
from .recipe import Draw, Pair, Recipe, bytes_of, npy_bytes

_PIECE_BYTES = 1 << 18  # that are copied at once into an archive; pieces beyond this are slower, of fresh memory
AddPair = Callable[[Pair], None]
Loaded = tuple[Draw, npt.NDArray[Any], "npt.NDArray[Any] | None"]


@contextlib.contextmanager
def whole(path: Path, folder: Path | None = None) -> Iterator[BinaryIO]:
    """A file that is written elsewhere in the set's folder (None: the file's), and gets its name when it is whole."""
    folder = folder or path.parent
    name = path.relative_to(folder).as_posix()
    part = folder / f".{name.replace('/', '-')}.{secrets.token_hex(8)}.part"
    try:
        with open(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666), "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())  # else a power cut may leave the name without the bytes
        path.parent.mkdir(parents=True, exist_ok=True)
        os.replace(part, path)
    except BaseException as error:
        with contextlib.suppress(OSError):
            os.unlink(part)
        full = isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)
        if full and "no space left for" not in str(error):  # else another file of the shard has said it
            raise OSError(
                errno.ENOSPC,
                f"there is no space left for {name}; finished shards stay: make room and call again",
                os.fspath(folder),
            ) from error
        raise


def sweep(folder: Path) -> None:
    """Takes away what killed workers left."""
    for part in folder.glob(".*.part"):
        part.unlink(missing_ok=True)


def shard_name(number: int) -> str:
    """In messages and, of archives, in the folder."""
    return f"shard-{number:06d}"


class Reader(Protocol):
    """Reads pairs of a set by their numbers; the image is None in a set without ideal images. May be pickled."""

    def load(self, place: int) -> Loaded: ...


class Format(Protocol):
    """A form of shards."""

    def files(self, folder: Path, number: int, with_ideal: bool) -> list[Path]:
        """Of one shard; it is there when all of them are. The first one is written last."""

    def any_shard(self, folder: Path) -> bool:
        """Whether the folder holds one."""

    def begin(self, folder: Path, recipe: Recipe, count: int, shard_size: int, with_ideal: bool) -> None:
        """Writes what describes the shards; once more for a larger count."""

    def shard(
        self, folder: Path, number: int, shard_size: int, with_ideal: bool
    ) -> contextlib.AbstractContextManager[AddPair]:
        """Writes a shard whose pairs are then added in order."""

    def reader(self, folder: Path, description: dict[str, Any]) -> Reader: ...


def _not_whole(place: int, path: Path) -> errors.InvalidDataError:
    return errors.InvalidDataError(
        f"pair {place}: {path} does not hold it whole; remove that file, and let clspeckle.dataset.write() make it "
        "again"
    )


def _label(draw: Draw) -> bytes:
    return (json.dumps(dataclasses.asdict(draw)) + "\n").encode()


def _add(archive: tarfile.TarFile, name: str, data: bytes) -> None:
    info = tarfile.TarInfo(name)  # no time, no user: the same bytes each time
    info.size = len(data)
    info.mode = 0o644
    archive.addfile(info, io.BytesIO(data))


def _archive(file: BinaryIO) -> tarfile.TarFile:
    # The pieces of tarfile itself are of 16 KiB.
    return tarfile.TarFile(fileobj=file, mode="w", format=tarfile.USTAR_FORMAT, copybufsize=_PIECE_BYTES)


class _WebDataset:
    """One archive a shard, with three files a pair."""

    def files(self, folder: Path, number: int, with_ideal: bool) -> list[Path]:
        return [folder / f"{shard_name(number)}.tar"]

    def any_shard(self, folder: Path) -> bool:
        return any(folder.glob("shard-*.tar"))

    def begin(self, folder: Path, recipe: Recipe, count: int, shard_size: int, with_ideal: bool) -> None:
        pass

    @contextlib.contextmanager
    def shard(self, folder: Path, number: int, shard_size: int, with_ideal: bool) -> Iterator[AddPair]:
        (path,) = self.files(folder, number, with_ideal)
        with whole(path) as file, _archive(file) as archive:

            def add(pair: Pair) -> None:
                key = f"{pair.draw.index:09d}"
                _add(archive, f"{key}.codes.npy", npy_bytes(pair.codes))
                if with_ideal:
                    _add(archive, f"{key}.ideal.npy", npy_bytes(pair.ideal))
                _add(archive, f"{key}.json", _label(pair.draw))

            yield add

    def reader(self, folder: Path, description: dict[str, Any]) -> Reader:
        return _ArchiveReader(folder, description)


class _ArchiveReader:
    def __init__(self, folder: Path, description: dict[str, Any]) -> None:
        self.folder, self.description = folder, description
        self._offsets: dict[int, dict[str, tuple[int, int]]] = {}

    def load(self, place: int) -> Loaded:
        number = place // self.description["shard_size"]
        with_ideal = self.description["with_ideal"]
        (path,) = _WebDataset().files(self.folder, number, with_ideal)
        try:
            loaded = self._load(path, place, number, with_ideal)
            if loaded[0].index != place:
                raise ValueError("another pair")
            return loaded
        except (tarfile.TarError, EOFError, ValueError, TypeError, KeyError):
            raise _not_whole(place, path) from None

    def _load(self, path: Path, place: int, number: int, with_ideal: bool) -> Loaded:
        if number not in self._offsets:
            with tarfile.open(path) as archive:
                self._offsets[number] = {m.name: (m.offset_data, m.size) for m in archive}
        members = self._offsets[number]

        def load(ending: str) -> bytes:
            offset, size = members[f"{place:09d}.{ending}"]
            file.seek(offset)
            return file.read(size)

        with path.open("rb") as file:
            kinds = ["codes", *(["ideal"] if with_ideal else [])]
            images = [np.load(io.BytesIO(load(f"{kind}.npy")), allow_pickle=False) for kind in kinds]
            return Draw(**_json_file.parse_json(load("json"))), images[0], images[1] if with_ideal else None


def _crc_table() -> list[int]:
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (0x82F63B78 if byte & 1 else 0)
        table.append(byte)
    return table


_CRC_TABLE = _crc_table()


def crc32c(data: bytes) -> int:
    """Castagnoli's checksum, as Zarr's index has it."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc = _CRC_TABLE[(crc ^ byte) & 0xFF] ^ crc >> 8
    return crc ^ 0xFFFFFFFF


_NOT_THERE = 2**64 - 1  # of Zarr's index: no such chunk
_LARGEST_SHARD = 10**6  # each file has 16 bytes of index for every pair that its shard can hold
_DTYPES = {"codes": "<u2", "ideal": "<f4"}
_LITTLE_ENDIAN = {"name": "bytes", "configuration": {"endian": "little"}}


class _Zarr:
    """A group with the arrays `codes`, `ideal` and `labels` (JSON in strings), a pair in each chunk.

    Zarr's version 3 with its sharding codec: chunks are in files of `shard_size`, not compressed, as codes hardly can
    be. See https://zarr-specs.readthedocs.io/en/latest/v3/codecs/sharding-indexed/index.html.
    """

    def _names(self, with_ideal: bool) -> list[str]:
        return ["codes", *(["ideal"] if with_ideal else []), "labels"]

    def files(self, folder: Path, number: int, with_ideal: bool) -> list[Path]:
        ends = {"labels": ""}
        return [folder / name / f"c/{number}{ends.get(name, '/0/0')}" for name in self._names(with_ideal)]

    def any_shard(self, folder: Path) -> bool:
        return any(folder.glob("codes/c/*/0/0"))

    def begin(self, folder: Path, recipe: Recipe, count: int, shard_size: int, with_ideal: bool) -> None:
        if shard_size > _LARGEST_SHARD:
            raise errors.InvalidArgumentError(
                f"shard_size is {shard_size}; files of Zarr have an index for as many pairs: expected at most "
                f'{_LARGEST_SHARD}, or the format "webdataset"'
            )
        shapes = [recipe.ideal(scene).shape for scene in range(len(recipe.scenes))]
        for scene, shape in enumerate(shapes):
            if shape != shapes[0]:
                raise errors.InvalidArgumentError(
                    f"scene {scene} is {shape[0]} x {shape[1]}, the first {shapes[0][0]} x {shapes[0][1]}; arrays of "
                    'Zarr need scenes of one size: give such, or the format "webdataset"'
                )

        def put(name: str, content: dict[str, Any]) -> None:
            with whole(folder / name / "zarr.json", folder) as file:
                file.write((json.dumps({**content, "zarr_format": 3, "attributes": {}}, indent=1) + "\n").encode())

        for name in self._names(with_ideal):
            image, text = list(shapes[0]), name == "labels"
            inner = {"name": "vlen-utf8"} if text else _LITTLE_ENDIAN
            end: list[int] = [] if text else image
            sharding = {
                "chunk_shape": [1, *end],
                "codecs": [inner],
                "index_codecs": [_LITTLE_ENDIAN, {"name": "crc32c"}],
                "index_location": "end",
            }
            put(
                name,
                {
                    "node_type": "array",
                    "shape": [count, *end],
                    "data_type": "string" if text else np.dtype(_DTYPES[name]).name,
                    "dimension_names": ["pair", "y", "x"][: 1 + len(end)],
                    "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [shard_size, *end]}},
                    "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
                    "fill_value": "" if text else 0,
                    "codecs": [{"name": "sharding_indexed", "configuration": sharding}],
                },
            )
        put("", {"node_type": "group"})

    @contextlib.contextmanager
    def shard(self, folder: Path, number: int, shard_size: int, with_ideal: bool) -> Iterator[AddPair]:
        names = self._names(with_ideal)
        with contextlib.ExitStack() as stack:
            files = [stack.enter_context(whole(path, folder)) for path in self.files(folder, number, with_ideal)]
            indices: dict[str, list[int]] = {name: [] for name in names}

            def add(pair: Pair) -> None:
                label = _label(pair.draw)
                parts: dict[str, bytes | memoryview] = {
                    "codes": bytes_of(pair.codes.astype(_DTYPES["codes"], copy=False)),
                    "ideal": bytes_of(pair.ideal.astype(_DTYPES["ideal"], copy=False)),
                    "labels": struct.pack("<II", 1, len(label)) + label,  # one text, and its length
                }
                for name, file in zip(names, files):
                    indices[name] += [file.tell(), len(parts[name])]
                    file.write(parts[name])

            yield add
            for name, file in zip(names, files):
                index = np.full(2 * shard_size, _NOT_THERE, "<u8")
                index[: len(indices[name])] = indices[name]
                file.write(index.tobytes() + struct.pack("<I", crc32c(index.tobytes())))

    def reader(self, folder: Path, description: dict[str, Any]) -> Reader:
        return _ZarrReader(folder, description)


class _ZarrReader:
    def __init__(self, folder: Path, description: dict[str, Any]) -> None:
        self.folder, self.description = folder, description
        try:
            about = _json_file.read_json(folder / "codes" / "zarr.json")
            self.shape = tuple(about["shape"][1:])
        except (OSError, ValueError, KeyError) as error:
            raise errors.InvalidArgumentError(
                f"{folder}/codes/zarr.json: {error}; clspeckle.dataset.write() with a larger count writes it again"
            ) from None

    def load(self, place: int) -> Loaded:
        size, with_ideal = self.description["shard_size"], self.description["with_ideal"]
        number, entry = divmod(place, size)
        found: dict[str, Any] = {}
        for path in _Zarr().files(self.folder, number, with_ideal):
            name = path.relative_to(self.folder).parts[0]
            try:
                offset, chunk = self._chunk(path, size - entry)
                if name == "labels":
                    found[name] = Draw(**_json_file.parse_json(chunk[8:]))
                    right = found[name].index == place
                else:
                    found[name] = np.frombuffer(chunk, _DTYPES[name]).reshape(self.shape).copy()
                    right = offset == entry * len(chunk)  # else the index is that of a file that was cut off
                if not right:
                    raise ValueError("another pair")
            except (ValueError, TypeError, struct.error):
                raise _not_whole(place, path) from None
        return found["labels"], found["codes"], found.get("ideal")

    def _chunk(self, path: Path, from_end: int) -> tuple[int, bytes]:
        """Where the chunk begins that the index names in its place from the end, and its bytes."""
        with path.open("rb") as file:
            end = file.seek(0, os.SEEK_END)
            file.seek(max(0, end - 16 * from_end - 4))
            offset, length = struct.unpack("<QQ", file.read(16))
            if offset + length > end:
                raise ValueError("no such chunk")
            file.seek(offset)
            return offset, file.read(length)


FORMATS: dict[str, Format] = {"webdataset": _WebDataset(), "zarr": _Zarr()}

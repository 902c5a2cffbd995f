"""Philox4x32-10 and what the library makes of its words.

Source: J. K. Salmon, M. A. Moraes, R. O. Dror, D. E. Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC'11:
multipliers and Weyl constants of Philox4x32, ten rounds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MULTIPLIER_0 = np.uint64(0xD2511F53)
MULTIPLIER_1 = np.uint64(0xCD9E8D57)
WEYL_0 = 0x9E3779B9  # golden ratio
WEYL_1 = 0xBB67AE85  # sqrt(3) - 1
ROUNDS = 10
_MASK_32 = np.uint64(0xFFFFFFFF)
_SHIFT_32 = np.uint64(32)

# (counter, key, block): the lines "philox4x32 10" of tests/kat_vectors in Random123.
KNOWN_ANSWERS: list[tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...]]] = [
    (
        (0x00000000, 0x00000000, 0x00000000, 0x00000000),
        (0x00000000, 0x00000000),
        (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8),
    ),
    (
        (0xFFFFFFFF, 0xFFFFFFFF, 0xFFFFFFFF, 0xFFFFFFFF),
        (0xFFFFFFFF, 0xFFFFFFFF),
        (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD),
    ),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]


def philox4x32_10(counters: NDArray[np.uint32], key: tuple[int, int] | NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Blocks of four words for counters of shape (..., 4) and one key of two words.

    One round: with (hi_0, lo_0) = M_0 c_0 and (hi_1, lo_1) = M_1 c_2 as 64-bit products,
    (c_0, c_1, c_2, c_3) <- (hi_1 ^ c_1 ^ k_0, lo_1, hi_0 ^ c_3 ^ k_1, lo_0); the key goes up by the Weyl constants
    between rounds.
    """
    counters = np.asarray(counters, dtype=np.uint32)
    c0, c1, c2, c3 = (counters[..., i].astype(np.uint64) for i in range(4))
    k0, k1 = int(key[0]), int(key[1])
    for _ in range(ROUNDS):
        product_0 = MULTIPLIER_0 * c0
        product_1 = MULTIPLIER_1 * c2
        c0, c1, c2, c3 = (
            (product_1 >> _SHIFT_32) ^ c1 ^ np.uint64(k0),
            product_1 & _MASK_32,
            (product_0 >> _SHIFT_32) ^ c3 ^ np.uint64(k1),
            product_0 & _MASK_32,
        )
        k0 = (k0 + WEYL_0) & 0xFFFFFFFF
        k1 = (k1 + WEYL_1) & 0xFFFFFFFF
    return np.stack([c0, c1, c2, c3], axis=-1).astype(np.uint32)


def image_blocks(
    height: int, width: int, seed: int, frame_index: int, stream: int, first_column: int = 0
) -> NDArray[np.uint32]:
    """Blocks of an image, shape (Q, width, 4) with Q = ceil(height / 4) (philox.h, image mapping).

    Counter (x, y mod Q, frame & 0xffffffff, stream | (frame >> 32) << 16), key (seed & 0xffffffff, seed >> 32).
    """
    if not 0 <= frame_index < 2**48:
        raise ValueError("frame_index must be below 2^48")
    if not 0 <= stream < 2**16:
        raise ValueError("stream must be below 2^16")
    quarter = -(-height // 4)
    counters = np.empty((quarter, width, 4), dtype=np.uint32)
    counters[..., 0] = (np.arange(width) + first_column).astype(np.uint32)[None, :]
    counters[..., 1] = np.arange(quarter, dtype=np.uint32)[:, None]
    counters[..., 2] = frame_index & 0xFFFFFFFF
    counters[..., 3] = stream | (frame_index >> 32) << 16
    return philox4x32_10(counters, (seed & 0xFFFFFFFF, seed >> 32))


def _unfold(per_word: NDArray, height: int) -> NDArray:
    """(Q, width, 4) to (height, width): word j belongs to the rows j Q to (j + 1) Q - 1."""
    quarter, width, _ = per_word.shape
    return np.moveaxis(per_word, -1, 0).reshape(4 * quarter, width)[:height]


def image_words(height: int, width: int, seed: int, frame_index: int, stream: int) -> NDArray[np.uint32]:
    """The word of every pixel: word y // Q of the block of (x, y mod Q)."""
    return _unfold(image_blocks(height, width, seed, frame_index, stream), height)


def uniform(words: NDArray[np.uint32]) -> NDArray[np.float64]:
    """fma((float)w, 2^-32, 2^-33) in single precision, returned as float64.

    The single precision is part of the definition (-ln u depends on it where u is near 1). A word rounded to float
    has 24 bits, so product and sum are exact in float64 and the one rounding to float32 below is the one of the fma.
    """
    exact = words.astype(np.float32).astype(np.float64) * 2.0**-32 + 2.0**-33
    return exact.astype(np.float32).astype(np.float64)


def uniform_exact(words: NDArray[np.uint32]) -> NDArray[np.float64]:
    """(w + 1/2) / 2^32 in float64: what uniform() rounds."""
    return words.astype(np.float64) * 2.0**-32 + 2.0**-33


def phasor(words: NDArray[np.uint32]) -> NDArray[np.complex128]:
    """exp(2 pi i w / 2^32)."""
    angle = words.astype(np.float64) * (2.0 * np.pi * 2.0**-32)
    return np.cos(angle) + 1j * np.sin(angle)


def normal(blocks: NDArray[np.uint32], exact: bool = False) -> NDArray[np.float64]:
    """Normals of blocks of shape (..., 4), by Box and Muller (Ann. Math. Statist. 29 (1958) 610).

    Words 0 and 1 give r cos a and r sin a with r = sqrt(-2 ln uniform(word 0)), a = 2 pi word 1 / 2^32; words 2 and 3
    likewise. `exact` takes u = (w + 1/2) / 2^32 instead of its single-precision rounding.
    """
    to_uniform = uniform_exact if exact else uniform
    radius = np.sqrt(-2.0 * np.log(to_uniform(blocks[..., 0::2])))
    direction = phasor(blocks[..., 1::2])
    out = np.empty(blocks.shape, dtype=np.float64)
    out[..., 0::2] = radius * direction.real
    out[..., 1::2] = radius * direction.imag
    return out


def normal_pair(words: NDArray[np.uint32]) -> NDArray[np.float64]:
    """Two normals of each word, shape (..., 2): Box and Muller's with an angle of the first quadrant, whose place the
    word times 0xE78DDE6D tells, and the word's two lowest bits as signs."""
    product = (words.astype(np.uint64) * np.uint64(0xE78DDE6D)).astype(np.uint32).view(np.int32)
    angle = np.pi / 4 + 2 * np.pi * product.astype(np.float64) * 2.0**-34
    radius = np.sqrt(-2.0 * np.log(uniform(words)))
    first = np.where(words & 1, -1.0, 1.0) * np.cos(angle)
    second = np.where(words & 2, -1.0, 1.0) * np.sin(angle)
    return radius[..., None] * np.stack([first, second], axis=-1)


def image_pair_normal(
    height: int, width: int, seed: int, frame_index: int, stream: int, first_column: int = 0
) -> NDArray[np.float64]:
    """Normals of every pixel where rows 2 n and 2 n + 1 of each quarter share a block: its words' first normals are
    the even row's."""
    quarter = -(-height // 4)
    # The blocks of an image of half as many rows in each quarter.
    blocks = image_blocks(4 * ((quarter + 1) // 2), width, seed, frame_index, stream, first_column)
    pairs = normal_pair(blocks)  # rows / 2, width, word, parity
    rows = np.arange(height)
    row = rows % quarter
    return pairs[row // 2, :, rows // quarter, row % 2]


def image_uniform(height: int, width: int, seed: int, frame_index: int, stream: int) -> NDArray[np.float64]:
    """Uniforms of every pixel."""
    return uniform(image_words(height, width, seed, frame_index, stream))


def image_normal(
    height: int, width: int, seed: int, frame_index: int, stream: int, exact: bool = False
) -> NDArray[np.float64]:
    """Normals of every pixel."""
    return _unfold(normal(image_blocks(height, width, seed, frame_index, stream), exact), height)

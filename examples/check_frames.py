"""Checks the frames that the examples wrote.

usage: check_frames.py minimal PREFIX OTHER_PREFIX | check_frames.py engine PREFIX

Only the standard library is used, so that the check runs wherever the examples do.
"""

from __future__ import annotations

import math
import struct
import sys
from pathlib import Path

WIDTH, HEIGHT, TOP_CODE, BLACK_LEVEL = 320, 240, 1023, 64


def read_pgm(path: Path) -> list[int]:
    data = path.read_bytes()
    header = b"P5\n%d %d\n%d\n" % (WIDTH, HEIGHT, TOP_CODE)
    assert data.startswith(header), f"{path}: the header is {data[:20]!r}"
    codes = struct.unpack(f">{WIDTH * HEIGHT}H", data[len(header) :])
    assert max(codes) <= TOP_CODE, f"{path}: code {max(codes)}"
    return list(codes)


def moments(values: list[int]) -> tuple[float, float]:
    mean = sum(values) / len(values)
    return mean, math.sqrt(sum((v - mean) ** 2 for v in values) / (len(values) - 1))


def correlation(a: list[int], b: list[int]) -> float:
    (mean_a, deviation_a), (mean_b, deviation_b) = moments(a), moments(b)
    covariance = sum((x - mean_a) * (y - mean_b) for x, y in zip(a, b, strict=True)) / (len(a) - 1)
    return covariance / (deviation_a * deviation_b)


def check_minimal(prefix: str, other_prefix: str) -> None:
    frames = [read_pgm(Path(f"{prefix}_{i}.pgm")) for i in range(10)]
    for i in range(10):
        mine, other = Path(f"{prefix}_{i}.pgm").read_bytes(), Path(f"{other_prefix}_{i}.pgm").read_bytes()
        assert mine == other, f"frame {i} differs between {prefix} and {other_prefix}"
    assert len({tuple(frame) for frame in frames}) == 10, "two frames have the same noise"
    # Unit mean: the frame's mean is that of the ideal image, 2 pi 1.5^2 / 256 of the full signal of 512 codes.
    mean, _ = moments(frames[0])
    expected = BLACK_LEVEL + 512 * 2 * math.pi * 1.5**2 / 256
    assert abs(mean - expected) < 5, f"the mean is {mean:.1f}, expected {expected:.1f}"
    # Away from the dots only the black level and 4 codes of noise are left, and some light that diffraction puts there.
    row = frames[0][: WIDTH * 16]
    between = [row[y * WIDTH + x] for y in (0, 15) for x in range(WIDTH) if x % 16 in (0, 15)]
    assert moments(between)[0] < BLACK_LEVEL + 15, f"the gaps between the dots have {moments(between)[0]:.1f}"
    # The same speckle in all frames; what differs is noise of 4 codes a frame.
    difference = [a - b for a, b in zip(frames[0], frames[9], strict=True)]
    assert abs(moments(difference)[1] - 4 * math.sqrt(2)) < 0.3, f"noise {moments(difference)[1]:.2f}"
    assert correlation(frames[0], frames[9]) > 0.99
    # Dots of equal power look different: contrast sqrt((1 + p^2) / 2) = 0.79 at single points for p = 0.5.
    peaks = [
        frames[0][y * WIDTH + x] - BLACK_LEVEL
        for y in range(7, HEIGHT, 16)
        for x in range(WIDTH)
        if (x + (8 if y // 16 % 2 else 0)) % 16 == 7
    ]
    peak_mean, peak_deviation = moments(peaks)
    assert len(peaks) == 300
    assert 0.55 < peak_deviation / peak_mean < 0.95, f"contrast {peak_deviation / peak_mean:.2f}"


def check_engine(prefix: str) -> None:
    frames = [read_pgm(Path(f"{prefix}_{i}.pgm")) for i in range(4)]

    def part(frame: list[int], x0: int, x1: int, y0: int, y1: int) -> list[int]:
        return [frame[y * WIDTH + x] for y in range(y0, y1) for x in range(x0, x1)]

    for i in range(3):
        a, b = frames[i], frames[i + 1]
        # Far from the box nothing moved: the same speckle under new noise.
        still = correlation(part(a, 0, 80, 0, HEIGHT), part(b, 0, 80, 0, HEIGHT))
        assert still > 0.95, f"frames {i} and {i + 1}: the wall at rest has a correlation of {still:.3f}"
        # The box in the middle of its path is refreshed in both frames; its dots stay, its speckle does not.
        box = correlation(part(a, 130, 175, 95, 175), part(b, 130, 175, 95, 175))
        assert box < 0.8, f"frames {i} and {i + 1}: the box has a correlation of {box:.3f}"
    # The box is nearer, so it is brighter: (1.5 / 1.1)^2 = 1.9 times.
    near = moments(part(frames[0], 105, 175, 95, 175))[0] - BLACK_LEVEL
    far = moments(part(frames[0], 220, 320, 0, HEIGHT))[0] - BLACK_LEVEL
    assert 1.3 < near / far < 2.6, f"the box is {near / far:.2f} times as bright as the wall"


def main(arguments: list[str]) -> None:
    if len(arguments) == 3 and arguments[0] == "minimal":
        check_minimal(arguments[1], arguments[2])
    elif len(arguments) == 2 and arguments[0] == "engine":
        check_engine(arguments[1])
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])

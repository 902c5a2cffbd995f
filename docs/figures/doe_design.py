"""Draws the figures of docs/method/doe-design.md into docs/images, and prints the figures of its tables.

PYTHONPATH=bindings/python/src CLSPECKLE_LIBRARY=build/lib/libclspeckle.so .venv/bin/python docs/figures/doe_design.py
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import matplotlib

import clspeckle

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

RULES = {
    "gs": "Gerchberg-Saxton",
    "gsw": "weighted (GSW)",
    "nogrette": "adaptive (Nogrette)",
    "kim": "fixed phase (Kim)",
}


def row(name: str, design: clspeckle.DoeDesign) -> str:
    zero = f"{design.zero_order_relative:.3f}" + (" (wanted)" if design.zero_order_wanted else "")
    return (
        f"| {name} | {100 * design.efficiency:.1f} | {100 * design.grid_efficiency:.1f} "
        f"| {100 * design.uniformity_rms:.2f} | {100 * design.uniformity_peak_to_peak:.1f} | {zero} | "
        f"{design.largest_ghost_relative:.3f} "
        f"| {100 * design.other_orders:.1f} | {100 * design.beyond:.1f} | {design.seconds:.1f} |"
    )


def convergence(orders: NDArray[np.int32], path: Path) -> list[str]:
    """Each rule, continuous and with 8 levels."""
    rows = []
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.4))
    for rule, name in RULES.items():
        for levels, style in ((0, ":"), (8, "-")):
            iterations = 160 if levels == 0 else 100
            design = clspeckle.design_doe(orders, levels=levels, rule=rule, iterations=iterations)
            rows.append(row(f"{name}, {'continuous' if levels == 0 else f'{levels} levels'}", design))
            steps = np.arange(1, len(design.history) + 1)
            for axis, column in zip(axes, design.history.T):
                axis.plot(
                    steps, 100 * column, style, color=f"C{list(RULES).index(rule)}", label=name if levels else None
                )
    axes[0].set_ylabel("efficiency in %")
    axes[0].set_ylim(70, 82)
    axes[1].set_ylabel("uniformity error in % RMS")
    axes[1].set_yscale("log")
    axes[1].legend(fontsize=8)
    for axis in axes:
        axis.set_xlabel("iteration (dotted: continuous phase)")
        axis.axvline(100, color="0.8", zorder=0)
        axis.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    return rows


def far_field(phase: NDArray[np.float32]) -> NDArray[np.float64]:
    """Powers of all orders of the base band, order (0, 0) in the middle."""
    height, width = phase.shape
    grid = np.abs(np.fft.fftshift(np.fft.fft2(np.exp(1j * phase.astype(float)))) / phase.size) ** 2
    x, y = np.arange(width) - width // 2, np.arange(height) - height // 2
    return grid * (np.sinc(y / height) ** 2)[:, None] * (np.sinc(x / width) ** 2)[None, :]


def pictures(design: clspeckle.DoeDesign, binary: clspeckle.DoeDesign, path: Path) -> None:
    figure, axes = plt.subplots(2, 3, figsize=(11, 7))
    for line, (what, name) in zip(axes, ((design, "8 levels"), (binary, "2 levels"))):
        line[0].imshow(what.phase[:96, :96], cmap="twilight", vmin=0, vmax=2 * np.pi, interpolation="nearest")
        line[0].set_title(f"phase, {name}, 96 x 96 of 512 x 512 pixels", fontsize=9)
        powers = far_field(what.phase) / what.powers.mean()
        levels = 10 * np.log10(np.maximum(powers, 1e-4))
        line[1].imshow(levels, cmap="inferno", vmin=-40, vmax=0, extent=(-256.5, 255.5, 255.5, -256.5))
        line[1].set_title("power of the orders (m, n) in dB of a dot's", fontsize=9)
        line[2].imshow(powers[226:287, 226:287], cmap="gray", vmin=0, vmax=1.1, extent=(-30.5, 30.5, 30.5, -30.5))
        line[2].set_title("around the zero order, linear", fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def layouts(path: Path) -> list[str]:
    rows = []
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.6))
    cases = {
        "2509 on orders": {"count": 2509},
        "5303 on orders": {"count": 5303},
        "5303 on orders, symmetric": {"count": 5303, "point_symmetric": True},
        "2509 free": {"count": 2509, "lattice": False},
        "5303 free": {"count": 5303, "lattice": False},
    }
    shown = iter(axes)
    for name, options in cases.items():
        layout = clspeckle.dot_layout(**options)
        rows.append(
            f"| {name} | {layout.min_distance:.5f} | {layout.min_distance / layout.mean_spacing:.2f} "
            f"| {layout.mean_neighbors:.1f} | {layout.pair_count} | {layout.min_difference:.3f} | "
            f"{layout.mean_difference:.3f} |"
        )
        if name not in ("2509 on orders", "5303 on orders", "5303 free"):
            continue
        axis = next(shown)
        axis.plot(*layout.directions.T, "k.", markersize=1)
        first, second = layout.worst_pair
        for index, color in ((first, "C3"), (second, "C0")):
            u, v = layout.directions[index]
            axis.add_patch(plt.Circle((u, v), layout.neighborhood_radius, fill=False, color=color))
        axis.set_title(f"{name}; the two that are most alike ({layout.min_difference:.2f})", fontsize=8)
        axis.set_xlim(-math.sin(math.radians(30)), math.sin(math.radians(30)))
        axis.set_ylim(math.sin(math.radians(22.5)), -math.sin(math.radians(22.5)))
        axis.set_aspect("equal")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--images", type=Path, default=Path(__file__).resolve().parents[1] / "images")
    images: Path = parser.parse_args().images
    clspeckle.design_doe([[1, 0]], levels=8)  # kernels are compiled before times are taken
    orders = clspeckle.dot_layout(5303).orders
    twins = clspeckle.dot_layout(5303, point_symmetric=True).orders
    rows = convergence(orders, images / "doe_design_convergence.png")
    best = clspeckle.design_doe(orders, levels=8, search_sweeps=20)
    binary = clspeckle.design_doe(twins, levels=2)
    searched = clspeckle.design_doe(twins, levels=2, search_sweeps=20)
    rows += [row(f"weighted (GSW), {n} levels", clspeckle.design_doe(orders, levels=n)) for n in (4, 16)]
    rows += [row("weighted (GSW), 8 levels, then search", best), row("2 levels, symmetric list", binary)]
    rows += [row("2 levels, symmetric list, then search", searched)]
    print("5303 beams, cell of 512 x 512 pixels of 0.4 um, 940 nm, 60 x 45 degrees")
    head = "design|efficiency %|without envelope %|RMS %|peak to peak %|zero order / dot|ghost / dot|other %|beyond %|s"
    print("|" + head + "|")
    print("\n".join(rows))
    few = clspeckle.dot_layout(2509).orders
    print(row("2509 beams, 8 levels", clspeckle.design_doe(few, levels=8)))
    pictures(best, searched, images / "doe_design_far_field.png")
    print("| layout | least distance | of the mean spacing | neighbours | pairs | least difference | mean difference |")
    print("\n".join(layouts(images / "doe_design_layout.png")))


if __name__ == "__main__":
    main()

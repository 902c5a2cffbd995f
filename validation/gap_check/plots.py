"""The score as figures: confusion matrix, accuracy against strength and detectability, parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot as plt


def plot_confusion(confusion: dict[str, Any], path: Path) -> None:
    counts = np.array(confusion["counts"], float)
    truths, verdicts = confusion["truths"], confusion["verdicts"]
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    figure, axes = plt.subplots(figsize=(3 + 0.25 * len(verdicts), 2 + 0.25 * len(truths)), layout="constrained")
    image = axes.imshow(shares, cmap="Blues", vmin=0, vmax=1)
    axes.set_xticks(range(len(verdicts)), verdicts, rotation=90, fontsize=7)
    axes.set_yticks(range(len(truths)), truths, fontsize=7)
    for row, column in np.argwhere(counts > 0):
        color = "white" if shares[row, column] > 0.5 else "black"
        axes.text(column, row, f"{counts[row, column]:.0f}", ha="center", va="center", fontsize=6, color=color)
    axes.axvline(len(truths) - 0.5, color="0.6", linewidth=0.8)
    axes.set_xlabel("said")
    axes.set_ylabel("true")
    axes.set_title("Confusion matrix: number of sets, color by row")
    figure.colorbar(image, ax=axes, shrink=0.5, label="share of the effect's sets")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def plot_power(rows: list[dict[str, Any]], path: Path) -> None:
    """Detection and naming against strength, a line for each number of frames."""
    figure, both = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True, layout="constrained")
    titles = {"detected": "noticed", "included": "named, or among the equivalents"}
    for axes, (what, title) in zip(both, titles.items(), strict=True):
        for frames in sorted({row["frames"] for row in rows}):
            chosen = [row for row in rows if row["frames"] == frames]
            place = np.array([1 + row["strength"] for row in chosen])
            share = np.array([row[what]["share"] for row in chosen])
            bounds = np.array([row[what]["wilson95"] for row in chosen])
            (line,) = axes.plot(place, share, "o-", label=f"{frames} frames")
            axes.fill_between(place, bounds[:, 0], bounds[:, 1], color=line.get_color(), alpha=0.12)
        axes.set_xscale("log")
        axes.set_ylim(0, 1.03)
        axes.set_xlabel("part of the weak amplitude")
        axes.set_title(title)
        axes.grid(alpha=0.3)
    both[0].set_ylabel("share of sets (Wilson 95 %)")
    both[1].legend(fontsize=8)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def plot_accuracy(rows: list[dict[str, Any]], label: str, path: Path) -> None:
    filled = [row for row in rows if row["sets"]]
    figure, axes = plt.subplots(figsize=(6, 3.6), layout="constrained")
    place = np.arange(len(filled), dtype=float)
    for offset, (name, text, color) in enumerate(
        (
            ("detected", "noticed", "0.6"),
            ("included", "named, or among the equivalents", "tab:orange"),
            ("exact", "exactly named", "tab:blue"),
        )
    ):
        share = np.array([row[name]["share"] for row in filled])
        bounds = np.array([row[name]["wilson95"] for row in filled]).reshape(-1, 2)
        error = np.abs(np.stack([share - bounds[:, 0], bounds[:, 1] - share]))
        axes.errorbar(place + 0.12 * (offset - 1), share, error, fmt="o-", capsize=3, label=text, color=color)
    ticks = [f"above {row['low']:g}" if row["high"] is None else f"{row['low']:g} to {row['high']:g}" for row in filled]
    axes.set_xticks(place, [f"{tick}\n{row['sets']} sets" for tick, row in zip(ticks, filled, strict=True)], fontsize=8)
    axes.set_ylim(0, 1.03)
    axes.set_xlabel(label)
    axes.set_ylabel("share of sets (Wilson 95 %)")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def plot_parameters(rows: list[dict[str, Any]], path: Path) -> None:
    """Estimates over truths, each parameter's truth scaled to 1."""
    figure, axes = plt.subplots(figsize=(8, 3.8), layout="constrained")
    names = list(dict.fromkeys(f"{r['effect']}: {r['parameter']}" for r in rows))
    for row in rows:
        x = names.index(f"{row['effect']}: {row['parameter']}")
        scale = abs(row["truth"]) or 1.0
        ratio = 1 + (row["estimate"] - row["truth"]) / scale
        color = "0.5" if row["held"] is None else ("tab:blue" if row["held"] else "tab:red")
        if row["held"] is not None:
            bounds = [1 + (row[side] - row["truth"]) / scale for side in ("low", "high")]
            axes.plot([x, x], bounds, color=color, alpha=0.4)
        axes.plot(x, ratio, ".", color=color)
    axes.axhline(1, color="black", linewidth=0.8)
    axes.set_ylim(0.3, 1.7)
    axes.set_xticks(range(len(names)), names, rotation=90, fontsize=7)
    axes.set_ylabel("estimate / truth")
    axes.set_title("Fitted parameters; red: the 95 % interval misses the truth", fontsize=9)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def plot_ranks(counts: list[int], path: Path) -> None:
    """Ranks of the truths: even if the intervals are right, high at the ends if they are too short, to one side if
    biased."""
    count, bins = sum(counts), len(counts)
    even = count / bins
    scatter = 1.96 * np.sqrt(even * (1 - 1 / bins))
    figure, axes = plt.subplots(figsize=(5, 3.2), layout="constrained")
    axes.bar((np.arange(bins) + 0.5) / bins, counts, 0.9 / bins)
    axes.axhspan(max(0.0, even - scatter), even + scatter, color="0.6", alpha=0.3, label="by chance, 95 %")
    axes.set_xlim(0, 1)
    axes.set_xlabel("rank of the truth in the fitted distribution")
    axes.set_ylabel(f"parameters of {count}")
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def plot_score(score: dict[str, Any], folder: Path) -> list[Path]:
    """Writes the figures that the score has data for."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    if score["confusion"]["truths"]:
        for name, draw in (
            ("confusion.png", lambda p: plot_confusion(score["confusion"], p)),
            ("accuracy_strength.png", lambda p: plot_accuracy(score["strength"], "strength (0: weak, 1: strong)", p)),
            ("accuracy_detectability.png", lambda p: plot_accuracy(score["detectability"], "largest z", p)),
        ):
            draw(folder / name)
            written.append(folder / name)
    if score["parameters"]:
        plot_parameters(score["parameters"], folder / "parameters.png")
        written.append(folder / "parameters.png")
    if sum(score["calibration"]["ranks"]):
        plot_ranks(score["calibration"]["ranks"], folder / "ranks.png")
        written.append(folder / "ranks.png")
    return written

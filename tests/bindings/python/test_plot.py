"""clspeckle.plot: what the figures show is what was measured, beside the theory of the reference."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from reference import theory  # type: ignore[import-not-found,unused-ignore]

import clspeckle
from clspeckle import errors, plot, statistics

SIDE = 256


def speckled(context: clspeckle.Context, **camera: Any) -> tuple[npt.NDArray[np.float32], float]:
    """An evenly lit intensity, and the pupil's relative diameter."""
    with clspeckle.Pipeline.from_parameters(
        (SIDE, SIDE), output="intensity", seed=3, f_number=5.6, context=context, **camera
    ) as pipeline:
        flat = np.full((SIDE, SIDE), 7.0, np.float32)
        return pipeline.render(flat, refresh="all"), pipeline.aperture.info().relative_diameter


def lines(axis: Any) -> dict[str, tuple[npt.NDArray[Any], npt.NDArray[Any]]]:
    return {line.get_label(): line.get_data() for line in axis.get_lines()}


@pytest.mark.parametrize("polarization", [0.0, 0.5, 1.0])
def test_speckle_stands_beside_theory(context: clspeckle.Context, tmp_path: Path, polarization: float) -> None:
    """One seed. The contrast's standard error is 0.7 %; a histogram of 65,536 pixels is within 0.03 of its law."""
    intensity, diameter = speckled(context, degree_of_polarization=polarization)
    figure = plot.speckle(intensity, relative_diameter=diameter, degree_of_polarization=polarization, context=context)
    shown, histogram, covariance, bar = figure.axes
    assert bar.get_ylabel() == "DN"
    contrast = statistics.moments(intensity).contrast
    assert shown.get_title() == f"contrast {contrast:.3f}, theory {theory.contrast(polarization):.3f}"
    assert contrast == pytest.approx(theory.contrast(polarization), rel=0.03)

    (stairs,) = histogram.patches
    density, edges, _ = stairs.get_data()
    assert np.sum(density * np.diff(edges)) == pytest.approx(1, abs=0.01)
    exact = np.diff(theory.intensity_cdf(edges, polarization)) / np.diff(edges)
    np.testing.assert_allclose(density, exact, atol=0.06)
    ((light, law),) = lines(histogram).values()
    assert np.sum(law) * (light[1] - light[0]) == pytest.approx(1, abs=0.02)
    if polarization in (0.0, 1.0):  # a Gamma law is exact there
        step = 1e-4
        slope = (theory.intensity_cdf(light, polarization) - theory.intensity_cdf(light - step, polarization)) / step
        np.testing.assert_allclose(law, slope, atol=1e-3)

    seen = lines(covariance)
    measured = statistics.autocovariance(intensity, 12)
    assert np.array_equal(seen["along x"][1], measured[12])
    assert np.array_equal(seen["along y"][1], measured[:, 12])
    lag, airy = seen[f"Airy, D = {diameter:.3f}"]
    np.testing.assert_allclose(airy, theory.airy_autocovariance(np.abs(lag), diameter), atol=1e-12)
    assert np.abs(np.interp(seen["along x"][0], lag, airy) - measured[12]).max() < 0.04
    figure.savefig(tmp_path / "speckle.png")
    assert (tmp_path / "speckle.png").stat().st_size > 20000


def test_pixels_have_an_area(context: clspeckle.Context) -> None:
    intensity, diameter = speckled(context, fill_factor=1.0)
    figure = plot.speckle(intensity, relative_diameter=diameter, fill_factor=1.0, context=context)
    expected = float(figure.axes[0].get_title().rpartition(" ")[2])
    assert expected == pytest.approx(statistics.moments(intensity).contrast, rel=0.02)
    assert expected < 0.93
    lag, curve = lines(figure.axes[2])[f"Airy, D = {diameter:.3f}"]
    assert curve[len(curve) // 2] == pytest.approx(1, abs=1e-6)
    measured = statistics.autocovariance(intensity, 12)[12]
    assert np.abs(np.interp(np.arange(-12, 13), lag, curve) - measured).max() < 0.04


def test_measures_where_the_image_is(context: clspeckle.Context, monkeypatch: pytest.MonkeyPatch) -> None:
    used = []

    def noting(measure: Any) -> Any:
        def noted(*given: Any, **named: Any) -> Any:
            used.append(named["context"])
            return measure(*given, **named)

        return noted

    for name in ("moments", "histogram", "autocovariance"):
        monkeypatch.setattr(statistics, name, noting(getattr(statistics, name)))
    with clspeckle.Context() as other:
        ramp = np.arange(1.0, 1025, dtype=np.float32).reshape(32, 32)
        with clspeckle.DeviceImage.from_array(ramp, context=other) as image:
            plot.speckle(image)
    assert [each is other for each in used] == [True] * 3


def test_codes_have_bins_of_whole_codes(context: clspeckle.Context) -> None:
    intensity, diameter = speckled(context, degree_of_polarization=0.0)
    codes = np.clip(np.rint(64 + 9 * intensity / intensity.mean() * 20), 0, 1023).astype(np.uint16)
    figure = plot.speckle(codes, black_level_dn=64, relative_diameter=diameter, degree_of_polarization=0.0)
    density, edges, _ = figure.axes[1].patches[0].get_data()
    widths = np.diff(edges) * (codes.mean() - 64)
    np.testing.assert_allclose(widths, round(widths[0]))
    np.testing.assert_allclose(density, np.diff(theory.intensity_cdf(edges, 0.0)) / np.diff(edges), atol=0.08)
    bare = plot.speckle(codes, black_level_dn=64)
    assert set(lines(bare.axes[2])) == {"along x", "along y"}


def test_an_image_has_a_bar_of_its_codes(context: clspeckle.Context) -> None:
    codes = np.arange(1200, dtype=np.uint16).reshape(30, 40)
    figure = plot.image(codes, title="ramp")
    axis, bar = figure.axes
    assert axis.get_title() == "ramp"
    assert bar.get_ylabel() == "DN"
    assert axis.images[0].get_clim() == (0, pytest.approx(np.percentile(codes, 99.9)))
    assert np.array_equal(axis.images[0].get_array(), codes)
    with clspeckle.DeviceImage.from_array(codes, context=context) as device:
        assert np.array_equal(plot.image(device, low=10, high=20).axes[0].images[0].get_array(), codes)
    assert plot.image(np.full((4, 4), 3.0)).axes[0].images[0].get_clim() == (2, 3)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"degree_of_polarization": 1.5}, "degree_of_polarization is 1.5"),
        ({"fill_factor": -1}, "fill_factor is -1"),
        ({"relative_diameter": 0}, "relative_diameter is 0"),
        ({"max_lag": 0}, "max_lag is 0"),
        ({"max_lag": 64}, "max_lag is 64, expected less than the smaller side"),
        ({"black_level_dn": 9}, "mean is 3, black_level_dn 9; expected light above it"),
        ({"black_level_dn": math.nan}, "black_level_dn"),
    ],
    ids=str,
)
def test_wrong_numbers_are_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(errors.InvalidArgumentError, match=words):
        plot.speckle(np.full((64, 64), 3.0), **given)


def test_what_is_no_image_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    for function in (plot.image, plot.speckle):
        with pytest.raises(errors.ClspeckleError):
            function(np.zeros((3, 4, 5, 6)))
        with pytest.raises(errors.InvalidDataError):
            function(np.full((32, 32), np.nan))
    with pytest.raises(errors.InvalidArgumentError, match="low is 5, high 3; expected low below high"):
        plot.image(np.ones((4, 4)), low=5, high=3)
    for package in ("matplotlib", "matplotlib.figure"):
        monkeypatch.setitem(sys.modules, package, None)
    for function in (plot.image, plot.speckle):
        with pytest.raises(ImportError, match=r"needs matplotlib, .* pip install matplotlib"):
            function(np.random.default_rng(1).random((32, 32)))

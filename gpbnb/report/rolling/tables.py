"""Tables of the chapter on roll and deroll."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.report.display.tables import Table, with_uncertainty
from gpbnb.report.measurement import YEAR
from gpbnb.report.rolling import experiment, phase, theory


def registers(period: float, formats: Sequence[FloatFormat]) -> Table:
    """Tabulate what rounding ω_r costs in a year: in the worst case and with the actual rounding."""
    body = []
    for fmt in formats:
        for case, error in (
            ("worst", float(theory.worst_rate_error(period, fmt))),
            ("actual rounding", abs(experiment.rounded_rate_error(period, fmt))),
        ):
            body.append((arithmetic(fmt), case, *_cells(error)))
    header = (
        "register",
        "case",
        "$\\Delta\\omega$ (rad/s)",
        "phase after a year (rad)",
        "share of the signal lost, one dimension",
        "false drift at right angles, two dimensions (mas a year)",
    )
    return Table(f"What rounding the roll rate of {period:g} s costs", header, tuple(body))


def _cells(error: float) -> tuple[str, ...]:
    across = theory.off_tuned_drift(theory.DRIFTS[0], error)
    size = f"{across:,.0f}" if across >= 100 else f"{across:.3g}"
    # Beyond a quarter turn nothing is left: what is measured has the opposite sign.
    lost = "all" if error * YEAR >= math.pi / 2 else f"{theory.off_tuned_loss(error):.3e}"
    return f"{error:.3e}", f"{error * YEAR:.3e}", lost, size


def _small(value: float) -> str:
    # The rounding error of a zero differs from machine to machine.
    return f"{value:.2g}" if value > 1e-9 else "0"


def phase_costs(angles: Mapping[str, float], drift: tuple[float, float] = theory.DRIFTS) -> Table:
    """Tabulate the cost of a constant phase error: lost power in one dimension, error of both drifts in two."""
    body = []
    for name, angle in angles.items():
        x, y = theory.phase_error_cost(drift, angle)
        body.append((name, f"{100 * math.sin(angle) ** 2:.3g} %", f"{x:.3g}", f"{y:.3g}"))
    header = ("phase error", "power lost, one dimension", "geodetic (mas a year)", "frame dragging (mas a year)")
    return Table("What a phase error costs", header, tuple(body))


def varying_phases(limit: float, drift: tuple[float, float] = theory.DRIFTS) -> Table:
    """Tabulate the cost of phase errors that vary within ± `limit`, rad: their mean, and the false frame dragging.

    The false drift is computed to first order from the weighted mean, and simulated without noise.
    """
    body = []
    for name, shape in phase.SHAPES.items():
        plain, weighted = phase.means(shape)
        found = experiment.clean_drift_error(drift, lambda t, s=shape: limit * s(t / YEAR))  # type: ignore[misc]
        shown = (plain * math.degrees(limit) * 3600, weighted * limit * drift[0], found[1])
        body.append((name, *(f"{abs(value):.2f}" for value in shown)))
    header = (
        f"phase error between ±{math.degrees(limit) * 3600:.0f}″",
        "its mean (arcseconds)",
        "false frame dragging (mas a year)",
        "simulated (mas a year)",
    )
    return Table("What phase errors that vary cost", header, tuple(body))


def drift_errors(study: experiment.DriftStudy) -> Table:
    """Tabulate standard errors of a drift, simulated and in closed form, and the gain of rolling."""
    found = study.standard_error()
    duration = study.samples * study.interval
    plain = theory.drift_error_unrolled(study.level, duration, at_rest=True)
    body = []
    for i, period in enumerate(study.periods):
        closed = plain
        if period is not None:
            closed = theory.drift_error_rolled(study.level, period, duration, study.interval)
        body.append(
            (
                "none" if period is None else f"{period:g} s",
                with_uncertainty(found[i], found[i] * study.uncertainty()),
                f"{closed:.3g}",
                f"{(found[i] / closed - 1) / study.uncertainty():+.1f}",
                f"{plain / closed:.3g}",
            )
        )
    header = ("roll period", "simulated", "closed form", "difference / standard error", "gain over no roll")
    return Table("Standard error of a drift rate (mas a year)", header, tuple(body))


def filters(
    named: Mapping[str, object], drift: float, level: float, period: float, samples: int, interval: float
) -> Table:
    """Compare filters: lag, noise in the band, slow noise that passes, total noise, and the image in one dimension."""
    density = float(theory.flicker_density(level, 1 / period, interval))
    body = []
    for name, weights in named.items():
        image = experiment.image_behind(weights, drift, period, samples, interval)  # type: ignore[arg-type]
        total = theory.filtered_variance(weights, level, samples, period, interval)
        body.append(
            (
                name,
                f"{drift / YEAR * theory.filter_lag(weights, interval):.3g}",
                f"{math.sqrt(density * theory.noise_bandwidth(weights, interval)):.3g}",
                _small(math.sqrt(theory.pedestal(weights, level, samples, period, interval))),
                f"{math.sqrt(total):.3g}",
                _small(abs(image).max()),
            )
        )
    header = (
        "filter",
        "lag",
        "noise in the band",
        "slow noise let through",
        "total noise, exact",
        "image, one dimension",
    )
    return Table("What filters leave, in mas at the end of the record", header, tuple(body))


def needed(
    periods: Sequence[float], bases: Sequence[int], drift: float, steps: Sequence[int], error: float = 1.0
) -> Table:
    """Tabulate the digits that keep a year's deroll of a drift within an error in mas: observed, and by the bound."""
    body = []
    duration = steps[-1] * theory.INTERVAL
    limit = error / (drift * duration / YEAR)
    for period in periods:
        for base in bases:
            for method in ("recursion", "direct"):
                body.append(
                    (
                        f"{period:g} s",
                        str(base),
                        method,
                        str(experiment.digits_needed_observed(method, base, drift, period, steps, error)),
                        str(theory.digits_needed(theory.rotation_bound(method, period, steps[-1]), base, limit)),
                    )
                )
    header = ("roll period", "base", "method", "digits, observed", "digits, by the bound")
    return Table(f"Digits for {error:g} mas", header, tuple(body))

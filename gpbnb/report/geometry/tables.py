"""Tables of the chapter on measurement geometry."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from gpbnb.report.display.tables import Table
from gpbnb.report.geometry.experiment import MisalignedYear, Part
from gpbnb.report.geometry.theory import effect
from gpbnb.report.measurement import ARCSEC, MAS


def misalignments(results: Mapping[str, tuple[MisalignedYear, MisalignedYear]]) -> Table:
    """Tabulate the effect of each misalignment in milliarcseconds, from theory; for the drift, also from simulation.

    Parameters
    ----------
    results : for each angle, the results of :func:`gpbnb.report.geometry.experiment.years` without and with roll.
    """
    body = []
    for name, (still, rolled) in results.items():
        without, with_roll = effect(still.case, False), effect(rolled.case, True)
        body.append(
            (
                _symbols(name),
                pair(without.angle),
                pair(without.drift),
                number(with_roll.line),
                pair(with_roll.angle),
                pair(with_roll.drift),
                pair(rolled.error.drift),
            )
        )
    header = (
        "angle",
        "no roll: angle",
        "no roll: drift",
        "rolling: at roll frequency",
        "rolling: angle",
        "rolling: drift",
        "drift, simulated",
    )
    return Table("errors due to misalignments, in milliarcseconds", header, tuple(body))


def fates(results: Mapping[str, Mapping[str, Part]]) -> Table:
    """Tabulate the error due to each misalignment in both readings and in their difference; milliarcseconds.

    Parameters
    ----------
    results : for each angle, the result of :func:`gpbnb.report.geometry.experiment.parts`.
    """
    body = tuple(
        (
            _symbols(name),
            *(pair((part.mean, part.turning)) for part in parts.values()),
            fate(parts),
        )
        for name, parts in results.items()
    )
    readings = next(iter(results.values()), {})
    header = ("angle", *readings, "outcome")
    return Table(
        f"{len(body)} angles, errors in milliarcseconds: mean; oscillation at the roll frequency", header, body
    )


def fate(parts: Mapping[str, Part]) -> str:
    """State whether an error stays, averages out, cancels, or is measured; errors below 0.001 mas count as 0."""

    def seen(radians: float) -> bool:
        return number(radians) != "0"

    difference = parts["difference"]
    if seen(difference.mean):
        return "stays"
    if seen(difference.turning):
        return "averages out"
    if any(seen(value) for part in parts.values() for value in (part.mean, part.turning)):
        return "cancels"
    return "is measured"


def reach(rows: Iterable[tuple[str, float]], allowed: float) -> Table:
    """Tabulate how large each angle may be before its small-angle form causes an error of `allowed` radians."""
    body = tuple((_symbols(name), _two(size / ARCSEC), f"{math.degrees(size):.2g}") for name, size in rows)
    return Table(f"angles that cause an error of {allowed / MAS:g} mas", ("angle", "in arcseconds", "in degrees"), body)


def number(radians: float) -> str:
    """Format an angle in milliarcseconds, to 0.001 or four digits, whichever is coarser."""
    value = radians / MAS
    places = 3 if abs(value) < 10 else max(0, 3 - math.floor(math.log10(abs(value))))
    text = f"{value:,.{places}f}"
    return "0" if float(text.replace(",", "")) == 0 else text.replace("-", "−")


def pair(angles: Sequence[float]) -> str:
    """Format two angles in milliarcseconds, or a single 0 if both are zero."""
    both = [number(float(angle)) for angle in np.asarray(angles)]
    return "0" if both == ["0", "0"] else "; ".join(both)


def _two(value: float) -> str:
    """Format with two digits, because the expansion has no more correct digits at the largest angles."""
    return f"{float(f'{value:.2g}'):,.0f}"


def _symbols(name: str) -> str:
    """Turn every angle in `name`, such as ``gamma_rate2``, into a formula."""
    moving = re.sub(r"(alpha|beta|gamma)_rate(\d)", r"$\\dot\\\1_\2$", name)
    return re.sub(r"(?<!\\)\b(alpha|beta|gamma)(\d)", r"$\\\1_\2$", moving)

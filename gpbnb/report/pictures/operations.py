"""A step of the tracker as a graph of operations: which of them round, and how far each rounding error reaches."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch

from gpbnb.bounds.contributions import Contributions, contributions
from gpbnb.bounds.guarantee import FilterGuarantee
from gpbnb.filters.forms import Form
from gpbnb.filters.program import ADD, MULTIPLY, SUBTRACT, Program, values_of
from gpbnb.filters.run import Run
from gpbnb.report.display import style
from gpbnb.report.examples import tracker
from gpbnb.report.guarantees.certificates import tracker_guarantee
from gpbnb.report.guarantees.table import FORMAT
from gpbnb.report.pictures.picture import Input, Picture, short_number

STATES = {"position": "m", "velocity": "m/s"}
"""The states of the tracker and their units."""
_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_SIGNS = {ADD: "+", SUBTRACT: "−"}


class ListedValue(NamedTuple):
    """A value of a step: a state or a measurement before it, or the result of an operation.

    Parameters
    ----------
    name : its name, a letter with or without a subscript.
    formula : its operation in terms of earlier names; empty for a state or a measurement.
    operands : places in the list of the values that the operation takes.
    """

    name: str
    formula: str
    operands: tuple[int, ...]


def listing(program: Program) -> list[ListedValue]:
    """List the values before a step, then its operations; coefficients have names."""
    n, m = program.n, program.m
    lines = [
        ListedValue(_indexed(name, k, count), "", ()) for name, count in (("x", n), ("z", m)) for k in range(count)
    ]
    results = {int(value): k for k, value in enumerate(program.outputs)}
    letters = iter("abcdefghijklmnopqrstuvw")
    for o, (code, left, right) in enumerate(program.operations.tolist()):
        operands = values_of(code, left, right)
        names = [lines[at].name for at in operands]
        if code == MULTIPLY:
            formula = f"{_coefficient(program.coefficient_names[left], m)} {names[0]}"
        else:
            formula = f" {_SIGNS[code]} ".join(names)
        result = results.get(n + m + o)
        name = next(letters) if result is None else f"{_indexed('x', result, n)}′"
        lines.append(ListedValue(name, formula, operands))
    return lines


def _indexed(letter: str, k: int, count: int) -> str:
    return letter + (str(k + 1).translate(_SUBSCRIPTS) if count > 1 else "")


def _coefficient(name: str, m: int) -> str:
    """Write ``Phi[0][1]`` as Φ₁₂; the gain of one measurement has one index."""
    letter, *indices = re.findall(r"\w+", name)
    kept = indices[:1] if letter == "K" and m == 1 else indices
    return {"Phi": "Φ"}.get(letter, letter) + "".join(str(int(k) + 1).translate(_SUBSCRIPTS) for k in kept)


@cache
def _found() -> tuple[FilterGuarantee, Contributions]:
    found = tracker_guarantee()
    return found, contributions(found)


def _lines() -> list[ListedValue]:
    return listing(Run(tracker(), FORMAT, Form.INNOVATION, ()).linear_program())


def units(lines: Sequence[ListedValue], states: Sequence[str], measurement: str) -> list[str]:
    """Return the unit of each value: sums have that of their operands, and a product that of the sum that takes it."""
    found = ["" if line.formula else measurement for line in lines]
    found[: len(states)] = states
    for k, line in enumerate(lines):
        if line.name.endswith("′"):
            found[k] = states[[each.name for each in lines].index(line.name.removesuffix("′"))]
    sums = [(k, line.operands) for k, line in enumerate(lines) if len(line.operands) == 2]
    for k, operands in [*reversed(sums), *sums]:
        alike = (k, *operands)
        unit = next((found[at] for at in alike if found[at]), "")
        for at in alike:
            found[at] = found[at] or unit
    return found


def step_data() -> dict[str, Any]:
    """Return the values of a step in order, with the largest error of each operation and how far it reaches."""
    found, each = _found()
    lines = _lines()
    rows = []
    for k, (line, unit) in enumerate(zip(lines, units(lines, [*STATES.values()], "m"), strict=True)):
        o = k - found.schedule.program.n - found.schedule.program.m
        row: dict[str, Any] = {"name": line.name, "formula": line.formula, "operands": line.operands, "unit": unit}
        if o >= 0:
            row["error"] = short_number(each.errors[o])
            row["effects"] = [short_number(effect) for effect in each.effects[:, o]]
            row["sums"] = [short_number(total) for total in each.sums[:, o]]
        rows.append(row)
    return {
        "lines": rows,
        "states": [*STATES],
        "units": [*STATES.values()],
        "bounds": [short_number(bound) for bound in found.bound],
        "bits": FORMAT.precision,
    }


def _still() -> Figure:
    """Draw the values of a step from top to bottom, with arcs from operands to results and bars for their shares."""
    data = step_data()
    lines = data["lines"]
    fig, (ax,) = style.figure(height=4.2)
    for k, line in enumerate(lines):
        for operand in line["operands"]:
            arc = f"arc3,rad={0.5 if k - operand > 1 else 0.9}"
            ax.add_patch(
                FancyArrowPatch(
                    (0, -operand), (0, -k), connectionstyle=arc, arrowstyle="-", color=style.REFERENCE, lw=1.2
                )
            )
        words = f"{line['name']} = {line['formula']}" if line["formula"] else line["name"]
        ax.plot([0], [-k], "o", color=style.OBSERVED if line["formula"] else style.REFERENCE, ms=6)
        style.name(ax, words, (0, -k), style.BLACK, (10, 0))
        if line["formula"]:
            shares = [total / bound for total, bound in zip(line["sums"], data["bounds"], strict=True)]
            for share, shift, colour in zip(shares, (0.17, -0.17), style.COLOURS, strict=False):
                ax.barh(-k + shift, share, 0.3, left=1.1, color=colour)
            percent = " and ".join(f"{100 * share:.2g}" for share in shares)
            style.name(ax, f"{percent} %", (1.1 + max(shares), -k), style.BLACK, (8, 0))
    for state, colour in zip(data["states"], style.COLOURS, strict=False):
        ax.barh(0, 0, 0, left=1.1, color=colour, label=f"share of the bound of the {state}")
    ax.set_xlim(-0.75, 2.1)
    ax.set_ylim(0.6 - len(lines), 0.9)
    ax.axis("off")
    style.legend(ax, loc="lower center", bbox_to_anchor=(0.5, 0.97))
    return fig


_FORMULAS = tuple(f"{line.name} = {line.formula}" for line in _lines() if line.formula)

STEP = Picture(
    id="step",
    title="The operations of a step",
    inputs=(
        Input("operation", "Operation", 0, len(_FORMULAS) - 1, choices=_FORMULAS),
        Input("state", "Error of the", 0, len(STATES) - 1, choices=tuple(STATES)),
    ),
    start={"operation": _FORMULAS[0], "state": "position"},
    sentence="{formula} rounds by at most {error} {unit} in {bits} bits. The new position changes by {first} times "
    "this error, and the new velocity by {second} times. In all steps together, this operation can move the {name} by "
    "{sum} {total_unit}, which is {share} % of the bound.",
    caption="Below the states and the measurement, each row is an operation that rounds, and its arcs lead to its "
    "operands. Choose one with the list or tap it. Thick arcs show how its error reaches the new states. Products with "
    "0 and 1 and sums with 0, all exact, are left out.",
    data=step_data,
    still=_still,
    alt="The seven operations of a step that round, one below the other after the two states and the measurement. Arcs "
    "connect each with its operands. Two sums of the position have bars of about half the bound each; the five other "
    "operations together have less than a twentieth.",
)

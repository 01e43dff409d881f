"""The runs of a year of Gravity Probe B: models, formats and forms.

In one base, all formats use the same numbers. The model is stored once, in 14 bits or 4 decimal digits, and
measurements are whole milliarcseconds. So one reference serves all formats, and errors come only from the arithmetic.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import log_spaced
from gpbnb.filters.simulation import Simulation
from gpbnb.report.gravity_probe_b.model import YEAR, gravity_probe_b, gravity_probe_b_year

#: Format in which the model is stored, by base; every format of this base in :data:`CASES` contains it.
STORED = {2: FloatFormat(2, 14), 10: FloatFormat(10, 4)}

#: The models, with roll periods of 600 s as in the reports, 77.5 s as flown, and 600 s without process noise.
MODELS = ("roll 600 s", "roll 77.5 s", "no process noise")


class Case(NamedTuple):
    """One run of the year; a precision of 0 stands for the reference in double-double."""

    model: str
    base: int
    precision: int
    rounding: Rounding
    form: Form

    @property
    def fmt(self) -> FloatFormat | None:
        """The format of the run; None for double-double."""
        return FloatFormat(self.base, self.precision, self.rounding) if self.precision else None

    @property
    def reference(self) -> Case:
        """The case that serves as the reference for this one."""
        return Case(self.model, self.base, 0, Rounding.NEAREST, Form.INNOVATION)

    @property
    def name(self) -> str:
        """Name of the files for this case."""
        words = f"{self.model} {self.base} {self.precision} {self.rounding.value} {self.form.name.lower()}"
        return words.replace(" ", "-").replace(".", "_")


def _cases() -> tuple[Case, ...]:
    usual, flown, noiseless = MODELS
    nearest, chop = Rounding.documented()
    others = (Form.INNOVATION, Form.JOSEPH, Form.UD)
    cases = [Case(usual, 2, t, nearest, Form.HUNG) for t in (24, 18, 32, 14, 20, 53)]
    cases += [Case(usual, 2, t, chop, Form.HUNG) for t in (24, 18, 32)]
    cases += [Case(usual, 2, 24, nearest, form) for form in others]
    cases += [Case(usual, 10, 8, nearest, Form.HUNG), Case(usual, 10, 6, nearest, Form.HUNG)]
    cases += [Case(flown, 2, 24, nearest, Form.HUNG), Case(noiseless, 2, 24, nearest, Form.HUNG)]
    cases += [Case(usual, 2, t, nearest, Form.HUNG) for t in (22, 28)]
    cases += [Case(usual, 2, 18, nearest, form) for form in others]
    cases += [Case(usual, 2, 24, nearest, Form.HUNG_SECOND_GAIN), Case(usual, 10, 8, chop, Form.HUNG)]
    cases += [Case(usual, 10, 8, nearest, Form.UD), Case(usual, 10, 10, nearest, Form.HUNG)]
    cases += [Case(usual, 2, 24, chop, form) for form in others]
    cases += [Case(usual, 10, 8, nearest, form) for form in others[:2]]
    cases += [Case(usual, 10, 4, nearest, Form.HUNG), Case(usual, 10, 16, nearest, Form.HUNG)]
    cases += [Case(usual, 2, t, nearest, Form.HUNG) for t in (16, 26, 40)]
    cases += [Case(usual, 2, t, chop, Form.HUNG) for t in (14, 20, 28, 53)]
    cases += [Case(usual, 2, 53, nearest, form) for form in others]
    # Neighbours of the smallest precisions that meet a milliarcsecond a year, so that these are exact.
    cases += [Case(usual, 10, 9, nearest, Form.HUNG), *(Case(usual, 2, t, nearest, Form.HUNG) for t in (31, 33))]
    return tuple(cases)


#: All runs, the most informative first.
CASES = _cases()

#: Runs with their own contraction bound, the references of the first model, from which the other bounds follow.
BOUNDED_CASES = frozenset(Case(MODELS[0], base, 0, Rounding.NEAREST, Form.INNOVATION) for base in STORED)


@cache
def model(name: str, base: int) -> LinearModel:
    """Return one of :data:`MODELS` as stored in a base."""
    roll = "77.5" if name == MODELS[1] else "600"
    return gravity_probe_b(roll, process_noise=name != MODELS[2]).rounded(STORED[base])


@cache
def simulation(name: str) -> Simulation:
    """Return the simulated measurements, the same for both bases; the truth follows the model of base 2."""
    return gravity_probe_b_year(model(name, 2))


def checkpoint_steps(steps: int = YEAR) -> tuple[int, ...]:
    """Return the steps whose results are saved, three per decade."""
    return log_spaced(steps, 3)

r"""Closed forms for the error of digital integration.

This module gathers the public names of :mod:`~gpbnb.integration.walk`, :mod:`~gpbnb.integration.inputs` and
:mod:`~gpbnb.integration.precision`.

The letters are those of savage2016: :math:`\omega_{bw}` bandwidth of the input in rad/s, T cycle time in s,
:math:`f_c = 1/T` iteration rate in Hz, :math:`\mu = \omega_{bw}T`, :math:`\sigma_x` rms of the input in any unit. A
"factor" is dimensionless: it is divided by the units of the input and of T. Functions apply to arrays of
:math:`\mu` entry by entry.
"""

from gpbnb.integration.inputs import (
    RULES,
    Process,
    Rule,
    Step,
    best_possible_rate,
    exact_step,
    first_order,
    folded,
    resonant,
    rule_variance,
    walk_rate,
)
from gpbnb.integration.precision import (
    Errors,
    best_rate,
    correlation_factor,
    independent_best_rate,
    mean_chopping,
    mean_square_rounding,
    needed_precision,
    stall_rate,
    two_errors,
)
from gpbnb.integration.walk import (
    Discretization,
    SavageRecursion,
    approximation_ratio,
    discretize,
    error_variance,
    error_variance_recursion,
    exponents,
    langevin,
    printed_discretization_q22,
    printed_random_walk,
    printed_walk_factor,
    random_walk,
    rectangle_error_variance,
    required_rate,
    savage_recursion,
    series,
    settling_cycles,
    validity,
    walk_factor,
)

__all__ = [
    "RULES",
    "Discretization",
    "Errors",
    "Process",
    "Rule",
    "SavageRecursion",
    "Step",
    "approximation_ratio",
    "best_possible_rate",
    "best_rate",
    "correlation_factor",
    "discretize",
    "error_variance",
    "error_variance_recursion",
    "exact_step",
    "exponents",
    "first_order",
    "folded",
    "independent_best_rate",
    "langevin",
    "mean_chopping",
    "mean_square_rounding",
    "needed_precision",
    "printed_discretization_q22",
    "printed_random_walk",
    "printed_walk_factor",
    "random_walk",
    "rectangle_error_variance",
    "required_rate",
    "resonant",
    "rule_variance",
    "savage_recursion",
    "series",
    "settling_cycles",
    "stall_rate",
    "two_errors",
    "validity",
    "walk_factor",
    "walk_rate",
]

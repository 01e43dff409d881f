"""The checks of the printed statements, one module or package per topic of the book, with a file of judgements each."""

from collections.abc import Mapping

from gpbnb.report.ledger.checks import budget, geometry, integration, inversion, kalman, rolling, rounding
from gpbnb.report.ledger.judge import read
from gpbnb.report.ledger.registry import Checks

TOPICS: Mapping[str, Checks] = {
    "rounding": rounding.CHECKS,
    "inversion": inversion.CHECKS,
    "kalman": kalman.CHECKS,
    "rolling": rolling.CHECKS,
    "integration": integration.CHECKS,
    "budget": budget.CHECKS,
    "geometry": geometry.CHECKS,
}
"""The checks of each topic, in the order of the chapters."""

for _topic in (integration,):  # not judged by rows of data yet
    for _key, _check in read(_topic.__name__, vars(_topic)).items():
        _topic.CHECKS.add(_key)(_check)

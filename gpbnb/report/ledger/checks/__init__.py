"""The checks of the printed statements, one module or package per topic of the book."""

from collections.abc import Mapping

from gpbnb.report.ledger.checks import budget, geometry, integration, inversion, kalman, rolling, rounding
from gpbnb.report.ledger.registry import Checks
from gpbnb.report.ledger.unjudged import always, load_unjudged

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

for _topic, _findings in load_unjudged().items():
    for _key, _finding in _findings.items():
        TOPICS[_topic].add(_key)(always(_finding))

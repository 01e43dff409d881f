"""Certificates of the guarantees that the book states, and their verdicts.

``python -m gpbnb.report.guarantees.certificates`` writes the certificate of each guarantee in the book to a folder and
checks it with :mod:`gpbnb.bounds.check`. If words are given, it takes only the filters whose names contain one of them.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.bounds.check import NotProvedError, prove
from gpbnb.bounds.guarantee import FilterGuarantee, guarantee, limits
from gpbnb.filters.forms import Form
from gpbnb.interrupts import interruptible
from gpbnb.report.display.tables import Table
from gpbnb.report.examples import cyclic, tracker
from gpbnb.report.guarantees.table import CASES, FORMAT, case_guarantee
from gpbnb.report.sweep import Number, sweep_of_rows
from gpbnb.report.sweep import load as load_rows
from gpbnb.wordlength.required import required_precision

COMMAND = "python -m gpbnb.report.guarantees.certificates"
SLOW = ("altimeter", "tilt filter", "ten states")
"""Guarantees whose check takes more than some seconds."""
WITHOUT = {
    "random Kalman and linear filters": "proved when the surveys compute them, and not stored",
    "filters of one state in three to six bits": "their worst errors are known exactly",
    "Gravity Probe B over a number of steps": "not tried, because its runs have up to millions of steps",
    "systems that limit their values": "the checker covers products, sums and differences",
    "single steps, compared with Gappa": "Gappa bounds them, too, and a certificate is for all steps",
    "inverses of matrices": "they are not filters",
}
"""Guarantees in the book or in stored tables that have no certificate of their own, and why."""


class CheckedCertificate(NamedTuple):
    """A certificate, its size in bytes, and what the checker says; `seconds` are those of the processor."""

    name: str
    size: int
    seconds: Number
    verdict: str


def _cyclic() -> FilterGuarantee:
    """The filter with ten states of the chapter, in the UD form, whose gain repeats."""
    return guarantee(cyclic(10, 2, cycle=31, decay=0.8), FORMAT, limits(state=100, innovation=10), form=Form.UD)


def tracker_guarantee(factor: int = 1, fmt: FloatFormat = FORMAT) -> FilterGuarantee:
    """The tracker of the chapter, with limits that are wider by a factor."""
    return guarantee(tracker(), fmt, limits(state=[factor * 1000, factor * 30], innovation=factor * 8))


def _within_a_centimetre() -> FilterGuarantee:
    """The tracker in the least precision that keeps its errors within 0.01."""
    within = limits(state=[1000, 30], innovation=8)
    answer = required_precision(tracker(), 1, [0.01, 0.01], basis="guarantee", within=within)
    if not isinstance(answer.format, FloatFormat):
        raise ArithmeticError(f"got {answer}; needed a precision that meets the tolerance")
    return tracker_guarantee(fmt=answer.format)


def guarantees() -> dict[str, Callable[[], FilterGuarantee]]:
    """Return functions that compute the guarantees of the book, by name."""
    found = {case.make().name: lambda case=case: case_guarantee(case, case.make(), FORMAT) for case in CASES}
    return {
        **found,
        "ten states": _cyclic,
        "tracker, limits twice as wide": lambda: tracker_guarantee(2),
        "tracker, limits four times as wide": lambda: tracker_guarantee(4),
        "tracker within 0.01 m": _within_a_centimetre,
    }


def verdict(name: str, text: str) -> CheckedCertificate:
    """Check a certificate."""
    begin = time.process_time()
    try:
        prove(json.loads(text))
        answer = "proved"
    except NotProvedError as error:
        answer = f"not proved: {error}"
    except NotImplementedError as error:
        answer = f"not covered: {error}"
    return CheckedCertificate(name, len(text), f"{time.process_time() - begin:.1f}", answer)


# -- the stored table -------------------------------------------------------------------------------------------------


def checked(name: str) -> CheckedCertificate:
    """Compute a guarantee of the book, write its certificate and check it."""
    return verdict(name, guarantees()[name]().certificate())


def _same(stored: Sequence[str], computed: Sequence[str]) -> bool:
    """Whether two rows agree, apart from seconds, and from bytes: last digits of a guess depend on the machine."""
    return (stored[0], *stored[3:]) == (computed[0], *computed[3:])


SWEEP = sweep_of_rows("guarantees/certificates", CheckedCertificate, lambda: tuple(guarantees()), checked, same=_same)
load = partial(load_rows, SWEEP, CheckedCertificate)


def table(rows: Sequence[CheckedCertificate]) -> Table:
    """Tabulate the certificates and where they are checked, and what has none."""
    header = ("guarantee", "bytes", "seconds", "verdict", "checked in")
    body = [
        (
            each.name,
            f"{each.size:,}",
            each.seconds,
            each.verdict,
            "make certificates" if each.name in SLOW else "make test",
        )
        for each in rows
    ]
    body += [(name, "", "", f"not covered: {why}", "") for name, why in WITHOUT.items()]
    return Table("certificates", header, tuple(body))


# -- the command ------------------------------------------------------------------------------------------------------


def main(arguments: Sequence[str] | None = None) -> int:
    """Write and check certificates; return 1 if one is not proved."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Write and check certificates of the book's guarantees.")
    parser.add_argument("words", nargs="*", help="take only the filters whose names contain one of these words")
    parser.add_argument("--output", type=Path, default=Path(".cache/certificates"), help="folder for the certificates")
    given = parser.parse_args(arguments)
    given.output.mkdir(parents=True, exist_ok=True)
    sound = True
    for name, compute in guarantees().items():
        if given.words and not any(word in name for word in given.words):
            continue
        text = compute().certificate()
        (given.output / f"{name.replace(' ', '-').replace(',', '')}.json").write_text(text, encoding="utf-8")
        found = verdict(name, text)
        sound = sound and found.verdict == "proved"
        print(f"{found.name}: {found.size:,d} bytes, {found.seconds} s, {found.verdict}", flush=True)
    return 0 if sound else 1


if __name__ == "__main__":
    raise SystemExit(interruptible("python -m gpbnb.report.guarantees.certificates", main))

"""A slice of ``make exactness``, and whether it finds a wrong digit."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb import FloatFormat
from tests.corpus import conformance, package
from tests.corpus.__main__ import confirmed
from tests.corpus.draw import Draw, Float
from tests.corpus.oracle import rounds

pytestmark = pytest.mark.usefixtures("loops_at_once")
ROWS = [*conformance.rows()]
SEED = 2026
SOME = (
    "kalman 2", "kalman 7", "kalman 13", "kalman 17", "kalman 24", "known inputs 0", "known inputs 2", "known inputs 3",
    "known inputs 5", "known inputs 6", "decayed 7", "fixed kalman 3", "named kalman 10",
    "long kalman 3", "long kalman 4", "long kalman 7",
    "sums 2", "records 7", "blocks 8", "extended 0", "extended 2", "extended 7", "extended 19",
    "unscented 5", "smoother 12", "smoother 11", "smoother 13", "systems 5", "words 9", "words 20", "functions 12",
    "functions 13", "elementary 3", "matrices 24",
)  # fmt: skip


def kinds() -> dict[tuple[str, str], list[conformance.Row]]:
    """One row of each rounding by base and storage."""
    found: dict[tuple[str, str, str], list[conformance.Row]] = {}
    for row in ROWS:
        base = str(row.fmt.base) if isinstance(row.fmt, Float) else "2"
        found.setdefault((base, row.storage, row.fmt.rounding), []).append(row)
    chosen: dict[tuple[str, str], list[conformance.Row]] = {}
    for k, ((base, storage, _), rows) in enumerate(found.items()):
        chosen.setdefault((base, storage), []).append(rows[k * 7 % len(rows)])
    return chosen


@pytest.mark.long  # a slice of the conformance, which compiles loops for each kind of storage
@pytest.mark.parametrize(
    ("kind", "rows"), kinds().items(), ids=lambda kind: ", ".join(kind) if isinstance(kind, tuple) else ""
)
def test_formats_have_the_digits_of_independent_arithmetic(kind, rows):
    for row in rows:
        found = conformance.compare(row, 80, SEED)
        assert found.different == []
        assert min(found.compared.values()) > 5


def test_every_kind_of_storage_base_and_rounding_is_compared():
    kinds = {(row.storage, row.fmt.rounding) for row in ROWS}
    assert len({storage for storage, _ in kinds}) == 7
    assert len(kinds) == 7 * 7
    assert {row.fmt.base for row in ROWS if isinstance(row.fmt, Float)} == {2, 3, 10, 16}


@pytest.mark.parametrize(
    "fmt", [Float(2, 24), Float(10, 7), Float(3, 5), Float(2, 60), Float(2, 11, "even", -9, 9)], ids=str
)
def test_a_wrong_rounding_is_found(fmt, monkeypatch):
    row = conformance.Row("", fmt)
    assert conformance.compare(row, 40, SEED).different == []
    right = package.fmt_of
    monkeypatch.setattr(package, "fmt_of", lambda given: right(given._replace(rounding="chop")))
    found = conformance.compare(row, 40, SEED).different
    assert all(any(f": {name} " in text for text in found) for name in conformance.OPERATIONS)


@pytest.mark.parametrize("operation", ["add", "multiply", "divide", "sqrt"])
def test_rounding_twice_is_found(operation):
    """Operands are so hard that float64, rounded again to 48 bits, is wrong."""
    fmt = Float(2, 48, "even")
    operands = Draw(operation).operands(fmt, operation, 3000, rounds(fmt))
    x = [np.array([float(a) for a in column]) for column in zip(*operands, strict=True)]
    twice = FloatFormat(2, 48, "even").array(getattr(np, operation)(*x)).to_float()
    once = [float(a) for a in conformance.expected(fmt, operation, operands)]
    assert np.any(twice != once)


@pytest.mark.long  # a slice of the conformance
@pytest.mark.parametrize("name", conformance.NATIVE)
def test_processors_formats_have_the_digits_of_their_types(name):
    compared, different = conformance.native(name, 2000, SEED)
    assert compared > 4000
    assert different == 0


def test_another_format_of_a_processor_differs(monkeypatch):
    monkeypatch.setitem(conformance.NATIVE, "BINARY16", conformance.NATIVE["BFLOAT16"])
    assert conformance.native("BINARY16", 500, SEED)[1] > 100


@pytest.mark.parametrize("name", SOME)
def test_runs_with_other_inputs_have_the_digits_of_the_oracle(name):
    count, fault = confirmed(name, SEED)
    assert fault == ""
    assert count > 5

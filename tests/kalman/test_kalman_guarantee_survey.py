"""The survey of guarantees: what a sample recomputes, and a published filter."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gpbnb.arithmetic.rational import exact
from gpbnb.kalman.guarantee import survey
from gpbnb.kalman.guarantee.published import dynamax_tracking


def test_a_sample_recomputes_no_row_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = tuple(SimpleNamespace(seed=seed) for seed in range(9))
    computed: list[int] = []

    def compute(seed: int) -> object:
        computed.append(seed)
        return rows[seed] if seed != 4 else None

    monkeypatch.setattr(survey, "load", lambda: rows)
    monkeypatch.setattr(survey, "compute", compute)
    for count in (9, 20):
        computed.clear()
        assert survey.sample(count, 0) == [(rows[4], None)]
        assert sorted(computed) == list(range(9))
    computed.clear()
    survey.sample(3, 1)
    assert len(set(computed)) == 3


@pytest.mark.parametrize("seed", [8, 9, 26, 27])
def test_a_row_comes_out_again(seed: int) -> None:
    (row,) = (row for row in survey.load() if row.seed == seed)
    assert survey.compute(seed) == row


def test_the_command_computes_rows_again_into_the_same_folder(tmp_path) -> None:
    folder = tmp_path / "of" / "results"
    for _ in range(2):
        assert survey.main(["--rows", "1", "--output", str(folder)]) == 0
    lines = (folder / survey.FILE.name).read_text(encoding="utf-8").splitlines()
    assert lines[-1].split(",")[:6] == ["0", "3", "1", "10", str(survey.load()[0].precision), survey.load()[0].rounding]


def test_the_noises_of_dynamax_s_tracking_are_independent() -> None:
    """Its notebook has Q = 0.001 I and an initial covariance of 0.1 I."""
    model, unit = dynamax_tracking(), np.eye(4, dtype=int)
    assert (model.Q[0] == exact(unit) / 1000).all()
    assert (exact(unit) / 10 == model.P0).all()
    assert (model.R[0] == exact(np.eye(2, dtype=int))).all()

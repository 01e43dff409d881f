"""tests.guarantees.attack: no run of a seeded slice exceeds its bound, and the bounds are not far above."""

from __future__ import annotations

import pytest

from tests.guarantees import attack


@pytest.mark.long  # attacks
@pytest.mark.parametrize("seed", range(10))
def test_no_run_of_a_linear_system_exceeds_its_bound(seed: int) -> None:
    found = attack.linear(seed)
    assert found.kind == attack.KINDS[seed % 5]
    assert found.largest <= 1
    assert found.runs in (0, 11)
    assert not found.runs or found.largest > 0.02


def test_no_run_of_a_kalman_filter_exceeds_its_bound() -> None:
    """A seed whose loops test_guarantees_filters compiles, too; `make attack` takes others each day."""
    assert 0.3 < attack.kalman(2).largest <= 1


def test_a_bound_that_promises_too_much_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = attack.output_errors
    monkeypatch.setattr(attack, "output_errors", lambda *given: whole(*given) / 50)
    with pytest.raises(AssertionError, match="of the bound"):
        attack.linear(5)

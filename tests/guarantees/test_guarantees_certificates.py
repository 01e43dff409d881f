"""gpbnb.report.guarantees.certificates: each guarantee of the book has a certificate, which is stored as proved."""

from __future__ import annotations

from gpbnb.report.guarantees import certificates, table


def test_every_certificate_of_the_book_is_stored_and_proved() -> None:
    rows = certificates.load()
    assert [row.name for row in rows] == list(certificates.guarantees())
    assert {row.verdict for row in rows} == {"proved"}


def test_every_filter_of_the_chapter_has_a_certificate() -> None:
    assert {row.name for row in table.load()} <= certificates.guarantees().keys()
    assert not certificates.guarantees().keys() & certificates.WITHOUT.keys()

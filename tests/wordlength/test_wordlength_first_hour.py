"""What a user takes for granted in a first hour; tests/refused.txt has the mistakes."""

from __future__ import annotations

import pytest

from gpbnb import (
    BINARY32,
    LinearSystem,
    write_code,
)

SYSTEM = LinearSystem([["0.9"]], [["0.1"]])


@pytest.mark.parametrize("name", ["filter.h", "filter.c", "test_filter.c", "filter_vectors.txt", "Makefile"])
def test_written_code_replaces_only_files_that_gpbnb_has_written(name, tmp_path):
    for _ in range(2):
        paths = write_code(SYSTEM, BINARY32, tmp_path)
    assert all(path.is_file() for path in paths)
    for path in paths:
        path.unlink()
    (tmp_path / name).write_text("my own\n")
    with pytest.raises(ValueError, match=f"in which {name} was not written by gpbnb; needed a folder without files"):
        write_code(SYSTEM, BINARY32, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "my own\n"

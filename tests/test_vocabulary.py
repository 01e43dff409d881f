"""The warnings of replaced words, which ``make lint`` shows."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
KINDS = ("prose", "identifiers")


def script():
    spec = importlib.util.spec_from_file_location("vocabulary", ROOT / "scripts" / "vocabulary.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_each_replaced_word_has_its_replacement():
    assert all(row["use"] and row["where"] in ("identifiers", "prose", "both") for row in script().REPLACED)
    assert len({(row["word"], row["where"]) for row in script().REPLACED}) == len(script().REPLACED)


def test_the_words_of_an_identifier():
    assert script().words_of("_BoundStatistics2_of") == {"bound", "statistics", "of"}


def test_a_replaced_word_is_found_in_text_and_in_identifiers(tmp_path):
    found = script()
    spoken, named = (next(row for row in found.replaced(where) if row["word"].isalpha()) for where in KINDS)
    file = tmp_path / "some.py"
    file.write_text(f'"""It has a {spoken["word"]}."""\n\n{named["word"]}_of = 1\n', encoding="utf-8")
    assert found.old_words(file) == {spoken["word"]: spoken["use"]}
    assert found.old_identifiers(file) == {f"{named['word']}_of": named["use"]}

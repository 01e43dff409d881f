"""Where caches are kept, and what their keys depend on."""

from __future__ import annotations

import ast
import errno
import os
import select
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from gpbnb import caching

ROOT = Path(__file__).resolve().parents[1]
SOURCES = sorted(caching.PACKAGE.rglob("*.py"))


def relative(files) -> set[str]:
    return {file.relative_to(caching.PACKAGE).as_posix() for file in files}


def named_by_parser(path: Path) -> set[Path]:
    """Files of the package that a file imports, found by Python's own parser."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name} imports relatively, which the scan for imports does not follow"
            names |= {str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    below = [caching.PACKAGE.joinpath(*name.split(".")[1:]) for name in names if name.split(".")[0] == "gpbnb"]
    return {file for p in below for file in (p.with_name(f"{p.name}.py"), p / "__init__.py") if file.is_file()}


def test_the_scan_for_imports_finds_what_the_parser_finds():
    for path in SOURCES:
        assert named_by_parser(path) <= caching._named(path.read_bytes()), path
    assert len(SOURCES) > 80


def test_imported_follows_the_imports_of_imports():
    found = relative(caching.imported(caching.PACKAGE / "arithmetic" / "kernels" / "elementwise.py"))
    assert {"arithmetic/kernels/elementwise.py", "arithmetic/kernels/binary.py", "arithmetic/kernels/bits.py"} <= found
    assert not any(name.startswith(("kalman", "ledger", "display")) for name in found)


def test_a_digest_depends_on_names_and_contents_and_not_on_the_order(tmp_path):
    a, b, c = (tmp_path / name for name in "abc")
    a.write_text("1"), b.write_text("2"), c.write_text("1")
    assert caching.digest([a, b]) == caching.digest([b, a, b])
    assert len({caching.digest(files) for files in ([a], [b], [c], [a, b], [a, c], [])}) == 6


def folder_in(environment: dict[str, str], package: Path) -> str:
    """Ask a fresh interpreter, with a package copied elsewhere, where its cache is."""
    code = "from gpbnb.caching import cache_folder; print(cache_folder('x'))"
    known = {key: os.environ[key] for key in ("PATH", "LANG") if key in os.environ}
    run = [sys.executable, "-c", code]
    done = subprocess.run(run, env=known | environment, cwd=package, capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.fixture
def installed(tmp_path):
    """The package as it is installed: no pyproject.toml beside it."""
    (tmp_path / "site" / "gpbnb").mkdir(parents=True)
    for name in ("__init__.py", "caching.py", "clock.py", "names.py"):
        (tmp_path / "site" / "gpbnb" / name).write_bytes((caching.PACKAGE / name).read_bytes())
    return tmp_path / "site"


def test_each_folder_is_used_where_those_before_it_cannot_be(tmp_path, installed):
    blocked = tmp_path / "blocked"
    blocked.write_text("a file, so that no folder can be made below it, not even by root")
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    every = {
        "GPBNB_CACHE_DIR": str(tmp_path / "own"),
        "XDG_CACHE_HOME": str(tmp_path / "xdg"),
        "HOME": str(tmp_path / "home"),
        "TMPDIR": str(temporary),
    }
    home_cache = "home/Library/Caches/gpbnb/x" if sys.platform == "darwin" else "home/.cache/gpbnb/x"
    expected = ["own/x", "xdg/gpbnb/x", home_cache]
    for key, place in zip(list(every), [tmp_path / each for each in expected], strict=False):
        assert folder_in(every, installed) == str(place)
        every[key] = str(blocked)
    assert folder_in(every, installed).startswith(str(temporary / "gpbnb-"))


def test_a_checkout_keeps_its_cache_to_itself(tmp_path, installed):
    (installed / "pyproject.toml").touch()
    assert folder_in({"HOME": str(tmp_path)}, installed) == str(installed / ".cache" / "gpbnb" / "x")


NOBODY = 65534
AS_ROOT = pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give files away")


@pytest.fixture
def candidates(tmp_path, installed, monkeypatch):
    """A folder for each variable that names one, and a folder for temporary files."""
    monkeypatch.setattr(caching, "PACKAGE", installed / "gpbnb")
    monkeypatch.setattr(caching.tempfile, "tempdir", str(tmp_path / "last"))
    caching._warn.cache_clear()
    for name in ("GPBNB_CACHE_DIR", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.setenv(name, str(tmp_path / name / "kept"))
        (tmp_path / name / "kept").mkdir(parents=True, mode=0o700)
    (tmp_path / "last").mkdir()
    yield tmp_path
    caching._warn.cache_clear()


def opened(mode):
    return lambda path: path.chmod(mode)


def given_away(path):
    os.chown(path, NOBODY, NOBODY)


def reached_by_a_link(path):
    """Move a folder aside, and link to it from a folder where others can replace the link."""
    path.rename(path.with_name("moved"))
    path.symlink_to(path.with_name("moved"))
    path.parent.chmod(0o777)


def linked_by_another(path):
    path.rename(path.with_name("moved"))
    path.symlink_to(path.with_name("moved"))
    os.chown(path, NOBODY, NOBODY, follow_symlinks=False)


@pytest.mark.skipif(caching.pwd is None, reason="no modes of files on this system")
@pytest.mark.parametrize("below", ["", "x"])
@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (opened(0o777), "others can write to {}"),
        (opened(0o775), "others can write to {}"),
        (opened(0o1777), "others can write to {}"),
        pytest.param(given_away, "{} belongs to the user with the number 65534", marks=AS_ROOT),
        (lambda path: path.parent.chmod(0o777), "others can write to {.parent}"),
        pytest.param(
            lambda path: given_away(path.parent), "{.parent} belongs to the user with the number 65534", marks=AS_ROOT
        ),
        (reached_by_a_link, "others can write to {.parent}"),
        pytest.param(linked_by_another, "{} belongs to the user with the number 65534", marks=AS_ROOT),
    ],
)
def test_a_folder_that_others_can_change_is_not_used(candidates, spoil, reason, below, capsys):
    """The folder of `below` is the one in which files are kept, otherwise the one that the variable names."""
    folder = candidates / "GPBNB_CACHE_DIR" / "kept" / below
    folder.mkdir(exist_ok=True, mode=0o700)
    assert caching.cache_folder("x") == candidates / "GPBNB_CACHE_DIR" / "kept" / "x"
    assert capsys.readouterr().err == ""
    spoil(folder)
    assert caching.cache_folder("x") == candidates / "XDG_CACHE_HOME" / "kept" / "gpbnb" / "x"
    assert caching.cache_folder("x") is not None
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("gpbnb: got a cache in ")
    assert f", but {reason.format(folder)}; needed a folder that only you can write" in line
    assert "set GPBNB_CACHE_DIR" in line


@pytest.mark.skipif(caching.pwd is None, reason="no modes of files on this system")
def test_every_folder_is_examined(candidates, capsys):
    for name in ("GPBNB_CACHE_DIR", "XDG_CACHE_HOME", "HOME"):
        (candidates / name / "kept").chmod(0o777)
    last = candidates / "last" / f"gpbnb-{os.geteuid()}" / "x"
    first = candidates / "first"
    first.mkdir(mode=0o700)
    assert caching.cache_folder("x", str(first)) == first
    first.chmod(0o777)
    assert caching.cache_folder("x", str(first)) == last
    assert len(capsys.readouterr().err.splitlines()) == 4
    last.parent.chmod(0o777)
    assert caching.cache_folder("x", str(first)) is None


@pytest.mark.skipif(caching.pwd is None, reason="no modes of files on this system")
def test_folders_are_created_for_the_user_alone_whatever_the_mask(candidates, monkeypatch):
    monkeypatch.setenv("GPBNB_CACHE_DIR", str(candidates / "a" / "b"))
    before = os.umask(0)
    try:
        found = caching.cache_folder("x")
        caching.write(found / "file", b"content")
        assert caching.read(found / "file") == b"content"
    finally:
        os.umask(before)
    assert found == candidates / "a" / "b" / "x"
    assert {path.stat().st_mode & 0o777 for path in (found, *found.parents[:2])} == {0o700}
    assert (found / "file").stat().st_mode & 0o777 == 0o600


@pytest.mark.skipif(caching.pwd is None, reason="no modes of files on this system")
def test_others_may_write_above_a_folder_if_they_cannot_replace_it(candidates, capsys):
    """As in /tmp, where a bit of the mode keeps each user's files."""
    (candidates / "GPBNB_CACHE_DIR").chmod(0o1777)
    assert caching.cache_folder("x") == candidates / "GPBNB_CACHE_DIR" / "kept" / "x"
    assert capsys.readouterr().err == ""


@pytest.mark.skipif(caching.pwd is None, reason="no groups on this system")
def test_the_group_of_one_user_may_write_above_a_folder(candidates, monkeypatch):
    """Many systems give each user a group of the same name, and let it write."""
    (candidates / "GPBNB_CACHE_DIR").chmod(0o775)
    number = (candidates / "GPBNB_CACHE_DIR").stat().st_gid
    alone = caching.pwd.struct_passwd(("ada", "x", 1000, number, "", "/", "/"))
    user = caching.pwd.struct_passwd(("root", "x", 0, number, "", "/", "/"))
    monkeypatch.setattr(caching.pwd, "getpwuid", lambda uid: now[0])
    monkeypatch.setattr(caching.grp, "getgrgid", lambda gid: caching.grp.struct_group((now[1], "x", gid, now[2])))
    for person, group, members, used in (
        (alone, "ada", [], True),
        (alone, "ada", ["ada"], True),
        (alone, "ada", ["bob"], False),
        (alone, "users", [], False),
        (user, "root", [], False),
    ):
        now = person, group, members
        caching._private.cache_clear()
        found = caching.cache_folder("x")
        assert (found == candidates / "GPBNB_CACHE_DIR" / "kept" / "x") is used, now
    caching._private.cache_clear()


def test_a_link_to_itself_is_no_folder(candidates, monkeypatch):
    (candidates / "loop").symlink_to(candidates / "loop")
    monkeypatch.setenv("GPBNB_CACHE_DIR", str(candidates / "loop"))
    assert caching.cache_folder("x") == candidates / "XDG_CACHE_HOME" / "kept" / "gpbnb" / "x"


def test_a_file_is_read_only_as_it_was_written(tmp_path):
    path, content = tmp_path / "file", bytes(range(256)) * 2
    assert caching.read(path) is None
    caching.write(path, content)
    whole = path.read_bytes()
    assert caching.read(path) == content
    damaged = [whole[:n] for n in range(len(whole))] + [bytes(len(whole)), whole + b"x", b""]
    damaged += [whole[:i] + bytes([whole[i] ^ 1 << i % 8]) + whole[i + 1 :] for i in range(len(whole))]
    for each in damaged:
        path.write_bytes(each)
        assert caching.read(path) is None
    caching.write(path, b"")
    assert caching.read(path) == b""
    path.rename(tmp_path / "another")
    assert caching.read(tmp_path / "another") is None
    (tmp_path / "folder").mkdir()
    caching.write(tmp_path / "folder", content)
    assert caching.read(tmp_path / "folder") is None
    assert sorted(each.name for each in tmp_path.iterdir()) == ["another", "folder"]


@pytest.mark.skipif(caching.pwd is None, reason="no modes of files on this system")
@pytest.mark.parametrize(
    "spoil", [opened(0o666), opened(0o620), reached_by_a_link, pytest.param(given_away, marks=AS_ROOT)]
)
def test_a_file_that_others_can_change_is_not_read(tmp_path, spoil):
    path = tmp_path / "file"
    caching.write(path, b"content")
    assert caching.read(path) == b"content"
    spoil(path)
    assert caching.read(path) is None


def test_files_that_were_not_used_for_a_month_are_removed(tmp_path):
    caching.write(tmp_path / "used", b"")
    for name, days in (("used", 40), ("old", 31), ("old.lock", 31), ("recent", 29)):
        (tmp_path / name).touch()
        then = time.time() - days * 24 * 3600
        os.utime(tmp_path / name, (then, then))
    assert caching.read(tmp_path / "used") == b""
    caching.remove_unused(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"used", "recent"}


@pytest.mark.skipif(caching.fcntl is None, reason="no locks on this system")
def test_a_lock_is_waited_for_as_long_as_is_said(tmp_path):
    held, found = caching.lock(tmp_path / "x", 1.0), []
    waiting = threading.Thread(target=lambda: found.append(caching.lock(tmp_path / "x", 0.0)), daemon=True)
    waiting.start()
    waiting.join(5.0)
    caching.unlock(tmp_path / "x", held)
    assert found == [None]


# Says when it waits for the lock and when it has it, and holds it until it is told to end.
HOLDER = """
import sys
from pathlib import Path
from gpbnb import caching

print("waits", flush=True)
held = caching.lock(Path(sys.argv[1]), 60.0)
print("holds" if held else "gave up", flush=True)
sys.stdin.readline()
caching.unlock(Path(sys.argv[1]), held)
"""


@contextmanager
def holder(path: Path):
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", HOLDER, str(path)], cwd=ROOT, **pipes) as process:
        assert process.stdout.readline() == "waits\n"
        yield process
        process.stdin.close()


@pytest.mark.skipif(caching.fcntl is None, reason="no locks on this system")
def test_a_process_that_waited_and_a_newcomer_do_not_both_hold_a_lock(tmp_path):
    """The waiting process has opened the file that the first holder removes."""
    path = tmp_path / "x"
    held = caching.lock(path, 1.0)
    with holder(path) as waiting:
        assert not select.select([waiting.stdout], [], [], 0.3)[0]  # it has opened the file by now
        caching.unlock(path, held)
        held = caching.lock(path, 0.0)
        # The other process looks at the lock 20 times a second, and may by chance have been quicker.
        says = bool(select.select([waiting.stdout], [], [], 1.0)[0])
        assert says == (held is None), "two processes hold one lock, or none does"
        caching.unlock(path, held)
        assert waiting.stdout.readline() == "holds\n"
    assert waiting.returncode == 0
    assert list(tmp_path.iterdir()) == []


# Takes the lock many times; whoever has it finds no mark of another holder.
TAKER = """
import os, sys
from pathlib import Path
from gpbnb import caching

path = Path(sys.argv[1])
for _ in range(300):
    handle = caching.lock(path, 60.0)
    os.close(os.open(path.with_name("mark"), os.O_CREAT | os.O_EXCL))
    os.unlink(path.with_name("mark"))
    caching.unlock(path, handle)
"""


@pytest.mark.skipif(caching.fcntl is None, reason="no locks on this system")
def test_four_processes_that_take_a_lock_in_turns_exclude_each_other(tmp_path):
    command = [sys.executable, "-c", TAKER, str(tmp_path / "x")]
    takers = [subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) for _ in range(4)]
    assert [taker.communicate()[1] for taker in takers] == [""] * 4
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(caching.fcntl is None, reason="no locks on this system")
def test_where_files_have_no_locks_nobody_waits(tmp_path, monkeypatch):
    def refuse(handle, how):
        raise OSError(errno.ENOLCK, "no locks")

    monkeypatch.setattr(caching.fcntl, "flock", refuse)
    began = time.monotonic()
    assert caching.lock(tmp_path / "x", 60.0) is None
    assert time.monotonic() - began < 30

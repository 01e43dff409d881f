"""Run all notebooks and numerical tests as on other machines, and print one line for each setting."""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import llvmlite.binding as llvm
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
# Tests of files of this project, of its prose and of pages give the same result everywhere.
NOT_NUMERICAL = ("pages", "test_environment.py", "test_prose.py", "test_book_extensions.py")
# What BLAS, LAPACK, libm and SIMD sums could change most. The chapters left out emulate arithmetic and compile long.
QUICK_NOTEBOOKS = ("rolling", "integration", "geometry", "inversion", "budget")
QUICK_TESTS = (
    "tests/arithmetic",
    "tests/geometry",
    "tests/integration",
    "tests/rolling",
    "tests/inversion",
    "tests/bounds/test_inverse.py",
)
NEHALEM = {"64bit", "cmov", "crc32", "cx16", "cx8", "fxsr", "mmx", "popcnt", "sahf"}
NEHALEM |= {"sse", "sse2", "sse3", "ssse3", "sse4.1", "sse4.2"}
NOT_HASWELL = ("avx512", "amx", "avxvnni", "avxifma", "avxneconvert", "avx10", "evex512")
SPACES = "Prüf stand/Gravity Probe B"


def processor(name: str) -> dict[str, str]:
    """Environment in which BLAS, NumPy and numba compute as on an older processor of this family."""
    host = [each for each, there in llvm.get_host_cpu_features().items() if there]
    dispatched = np._core._multiarray_umath.__cpu_dispatch__
    there = [each for each in dispatched if np._core._multiarray_umath.__cpu_features__.get(each)]
    if name == "nehalem":
        gone = [each for each in host if each not in NEHALEM]
        disabled = [each for each in there if each not in ("X86_V2", "SSE41", "SSE42", "POPCNT")]
    else:
        gone = [each for each in host if each.startswith(NOT_HASWELL)]
        disabled = [each for each in there if each.startswith(("AVX512", "X86_V4"))]
    return {
        "OPENBLAS_CORETYPE": name.title(),
        "NPY_DISABLE_CPU_FEATURES": " ".join(disabled),
        "NUMBA_CPU_NAME": name,
        "NUMBA_CPU_FEATURES": ",".join(f"-{each}" for each in sorted(gone)),
    }


def threads(number: int) -> dict[str, str]:
    return {key: str(number) for key in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")}


def locale(name: str) -> dict[str, str] | None:
    """Environment with a locale, which is made in the cache if the system lacks it; None if that is not possible."""
    folder = ROOT / ".cache" / "locale"
    there = subprocess.run(["locale", "-a"], capture_output=True, text=True).stdout if shutil.which("locale") else ""
    if f"{name}.utf8" in there.split():
        return {"LC_ALL": f"{name}.UTF-8"}
    folder.mkdir(parents=True, exist_ok=True)
    if shutil.which("localedef") is None:
        return None
    subprocess.run(["localedef", "-i", name, "-f", "UTF-8", str(folder / f"{name}.UTF-8")], capture_output=True)
    made = (folder / f"{name}.UTF-8").is_dir()
    return {"LC_ALL": f"{name}.UTF-8", "LOCPATH": str(folder)} if made else None


def settings() -> dict[str, dict[str, str] | None]:
    """Environments by the names of the settings; None where a setting cannot be had on this machine."""
    intel = platform.machine() in ("x86_64", "AMD64")
    return {
        "native": {},
        "haswell": processor("haswell") if intel else None,
        "nehalem": processor("nehalem") if intel else None,
        "blas-1": threads(1),
        "blas-4": threads(4),
        "hash-0": {"PYTHONHASHSEED": "0"},
        "hash-1": {"PYTHONHASHSEED": "1"},
        "locale-de": locale("de_DE"),
        "locale-tr": locale("tr_TR"),
        "chatham": {"TZ": "Pacific/Chatham"},
        "path": {},
    }


def copy_to(folder: Path) -> Path:
    """Copy what git knows of this checkout into a folder."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout
    for name in filter(None, listed.decode().split("\0")):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name)
    return folder


def run(name: str, environment: dict[str, str], jobs: int, only: Sequence[str], quick: bool) -> bool:
    """Run everything, or what is quick, in one setting, print its line, and say whether all passed."""
    log = ROOT / ".cache" / "portable" / f"{name}.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="gpbnb-portable-") as scratch, log.open("w") as output:
        root = copy_to(Path(scratch) / SPACES) if name == "path" else ROOT
        everything = os.environ | {"PYTHONPATH": str(root)} | environment
        chosen = {
            "notebooks": [f"book/{each}.ipynb" for each in QUICK_NOTEBOOKS] if quick else ["book"],
            "tests": QUICK_TESTS if quick else [*(f"--ignore=tests/{each}" for each in NOT_NUMERICAL), "tests"],
        }
        options = ["-q", "--nbval", "-n", str(jobs), "-o", f"cache_dir={scratch}/pytest"]
        command = [
            sys.executable,
            "-m",
            "pytest",
            *options,
            *(each for part in only or chosen for each in chosen[part]),
        ]
        began = time.monotonic()
        done = subprocess.run(command, cwd=root, env=everything, stdout=output, stderr=subprocess.STDOUT)
    passed = done.returncode == 0
    outcome = "passed" if passed else f"FAILED: see {log.relative_to(ROOT)}"
    print(f"{name:10} {outcome} ({time.monotonic() - began:.0f} s)", flush=True)
    return passed


def main() -> int:
    every = settings()
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument(
        "settings", nargs="*", choices=[[], *every], metavar="SETTING", help=f"default: all of {', '.join(every)}"
    )
    parser.add_argument("--jobs", type=int, default=2, help="number of processes; default: 2")
    parser.add_argument("--only", nargs="+", choices=["notebooks", "tests"], default=(), help="default: both")
    parser.add_argument("--quick", action="store_true", help="only some notebooks and tests, in about two minutes")
    given = parser.parse_args()
    passed = True
    for name in given.settings or every:
        environment = every[name]
        if environment is None:
            print(f"{name:10} not run: this machine does not support this setting", flush=True)
        else:
            passed = run(name, environment, given.jobs, given.only, given.quick) and passed
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())

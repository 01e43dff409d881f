#!/bin/sh
# Make .venv from environment.txt and install gpbnb into it, editable. Called by make.
set -eu
cd "$(dirname "$0")/.."

missing() {
    echo "gpbnb needs $1" >&2
    exit 1
}

command -v git >/dev/null 2>&1 || missing "git, and found none. Install it (Debian, Ubuntu: apt install git) and try again."

# A command that is found need not run: version managers leave shims for versions that are not there.
python= seen= novenv=
for candidate in ${PYTHON:+"$PYTHON"} python3 python3.14 python3.13 python3.12 python3.11 python /usr/bin/python3; do
    version=$("$candidate" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null) || continue
    seen="$seen $candidate ($version)"
    "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || continue
    if "$candidate" -c 'import venv, ensurepip' 2>/dev/null; then
        python=$candidate
        break
    fi
    novenv="$candidate ($version)"
done
if [ -z "$python" ]; then
    [ -z "$novenv" ] || missing "Python's venv and ensurepip modules, which $novenv lacks.
Install them (Debian, Ubuntu: apt install python3-venv) and try again."
    [ -z "$seen" ] || missing "Python 3.11 or newer, and found only$seen.
Install a newer one, or name it: make PYTHON=/path/to/python3"
    missing "Python 3.11 or newer, and found none.
Install it (Debian, Ubuntu: apt install python3 python3-venv), or name it: make PYTHON=/path/to/python3"
fi

echo "Making .venv with $python ($version). The first time this downloads about 280 MB."
# pip asks rustc for its version, which makes rustup write into the home folder.
export RUSTUP_HOME="$PWD/.cache/rustup"
rm -rf .venv
"$python" -m venv .venv
# Python compiles a module when it is first imported; most are never.
# environment.txt names every package that another needs: two processes install every second package each.
pids=
for half in 0 1; do
    awk -v half=$half '/^[^ #]/ { n++; built = /^filterpy==/ } n % 2 == half && !built' environment.txt > .venv/half-$half.txt
    .venv/bin/python -m pip install --quiet --no-compile --no-deps --require-hashes --only-binary :all: \
        -r .venv/half-$half.txt &
    pids="$pids $!"
done
for pid in $pids; do
    wait "$pid" || failed=1
done
[ -z "${failed:-}" ] || missing "the packages of environment.txt, which pip could not install; see above."
# filterpy has no wheel: setuptools, which is installed now, builds it.
awk '/^[^ #]/ { built = /^filterpy==/ } built' environment.txt > .venv/built.txt
.venv/bin/python -m pip install --quiet --no-compile --no-deps --require-hashes --no-build-isolation \
    --no-binary filterpy -r .venv/built.txt || missing "filterpy, which pip could not build; see above."
.venv/bin/python -m pip check
.venv/bin/python -m pip install --quiet --no-deps --no-build-isolation --no-index -e .

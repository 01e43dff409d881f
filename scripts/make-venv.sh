#!/bin/sh
# Make .venv from environment.txt and install gpbnb into it, editable. Called by make.
set -eu
cd "$(dirname "$0")/.."

# A command that is found need not run: version managers leave shims for versions that are not there.
for python in ${PYTHON:+"$PYTHON"} python3 python3.14 python3.13 python3.12 python3.11 none; do
    "$python" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && break
done
if [ "$python" = none ]; then
    echo "gpbnb needs Python 3.11 or newer with its venv and ensurepip modules, and found none. Install them (Debian," >&2
    echo "Ubuntu: apt install python3 python3-venv), or name a Python that has them: make PYTHON=/path/to/python3" >&2
    exit 1
fi

echo "Making .venv with $python. The first time this downloads about 200 MB."
# pip asks rustc for its version, which makes rustup write into the home folder.
export RUSTUP_HOME="$PWD/.cache/rustup"
rm -rf .venv
"$python" -m venv .venv
# Python compiles a module when it is first imported; most are never.
.venv/bin/python -m pip install --quiet --no-compile --no-deps --require-hashes --only-binary :all: -r environment.txt
.venv/bin/python -m pip install --quiet --no-deps --no-build-isolation --no-index -e .
.venv/bin/python -m pip check

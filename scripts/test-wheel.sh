#!/bin/sh
# Build the wheel, install it into an empty environment outside the checkout, and ask it a question there.
set -eu
here=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/python" -m pip install --quiet flit_core
cd "$here"
"$work/venv/bin/python" -c "
import sys
from flit_core import buildapi
print(buildapi.build_wheel(sys.argv[1]))" "$work"
"$work/venv/bin/python" -m pip install --quiet "$work"/*.whl
cd "$work"
unset PYTHONPATH
cat > model.toml <<'TOML'
Phi = [[1, 0.1], [0, 1]]
H = [[1, 0]]
Q = [[0.0001, 0], [0, 0.01]]
R = [[4]]
x0 = [0, 0]
P0 = [[100, 0], [0, 100]]
TOML
venv/bin/python -c "
import gpbnb, pathlib
folder = pathlib.Path(gpbnb.__file__).parent
assert 'site-packages' in str(folder) and (folder / 'py.typed').exists(), folder"
venv/bin/python -m gpbnb
venv/bin/python -m gpbnb wordlength model.toml --tolerance 0.01 --steps 100 --basis emulation --report report.html
test -s report.html && test -s report.json

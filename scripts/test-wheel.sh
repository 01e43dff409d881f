#!/bin/sh
# Build the wheel, install it into an empty environment outside the checkout, and ask it three questions there. Each
# question begins without compiled functions; the times are those that a new user waits.
set -eu
here=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/build"
"$work/build/bin/python" -m pip install --quiet flit_core
cd "$here"
"$work/build/bin/python" -c "
import sys
from flit_core import buildapi
print(buildapi.build_wheel(sys.argv[1]))" "$work"
cd "$work"
unset PYTHONPATH NUMBA_CACHE_DIR
export PYTHONNOUSERSITE=1 HOME="$work"
start=$(date +%s)
python3 -m venv venv
venv/bin/python -m pip install --quiet ./*.whl
installed=$(date +%s)
echo "installed in $((installed - start)) s"
venv/bin/python -c "
import gpbnb, pathlib
folder = pathlib.Path(gpbnb.__file__).parent
assert 'site-packages' in str(folder) and (folder / 'py.typed').exists(), folder
assert all(hasattr(gpbnb, name) for name in gpbnb.__all__)"
venv/bin/python -m gpbnb > commands.txt
cat > nile.toml <<'TOML'
name = "Nile, annual flow"
Phi = [[1]]
H = [[1]]
Q = [[1469.1]]
R = [[15099]]
x0 = [1000]
P0 = [[1e7]]
TOML
cat > tracker.toml <<'TOML'
name = "constant velocity"
Phi = [[1, 0.1], [0, 1]]
H = [[1, 0]]
Q = [[0.000033333333333333335, 0.0005], [0.0005, 0.01]]
R = [[4]]
x0 = [0, 0]
P0 = [[100, 0], [0, 100]]
TOML
cat > magnetometer.toml <<'TOML'
name = "magnetometer, tesla"
Phi = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
H = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
Q = [[1e-20, 0, 0], [0, 1e-20, 0], [0, 0, 1e-20]]
R = [[2.5e-15, 0, 0], [0, 2.5e-15, 0], [0, 0, 2.5e-15]]
x0 = [2e-5, 0, 4e-5]
P0 = [[1e-10, 0, 0], [0, 1e-10, 0], [0, 0, 1e-10]]
TOML
cat > ask.py <<'PYTHON'
import sys, time
from gpbnb import read_model, required_precision
answer = required_precision(read_model(sys.argv[1]), int(sys.argv[3]), float(sys.argv[2]))
print(f"{answer}; {time.process_time():.1f} s of processor time")
assert answer.fmt is not None
PYTHON
for question in "nile 1 100" "tracker 0.01 1000" "magnetometer 1e-9 1000"; do
	set -- $question
	for when in "first" "next"; do
		begin=$(date +%s)
		answer=$(NUMBA_CACHE_DIR="$work/cache-$1" venv/bin/python ask.py "$1.toml" "$2" "$3" 2> "$1.err")
		echo "$1, $when time, $(($(date +%s) - begin)) s: $answer"
	done
	NUMBA_CACHE_DIR="$work/cache-$1" venv/bin/python -m gpbnb wordlength "$1.toml" --tolerance "$2" --steps "$3" \
		--basis emulation --report "$1.html" > "$1.txt" 2> "$1.err"
	test -s "$1.html" && test -s "$1.json" && test -s "$1.txt"
done

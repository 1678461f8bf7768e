#!/bin/sh
# Builds the wheel, installs it in an empty environment outside the checkout, and runs a system
# from it: what the editable install of the tests cannot show.
set -eu
python=${PYTHON:-python3}
here=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$python" -m build --wheel --outdir "$work/dist" "$here" >"$work/build.log" 2>&1 || {
    cat "$work/build.log" >&2
    exit 1
}
# Built again, elsewhere and later, it is the same to the last byte.
"$python" -m build --wheel --outdir "$work/again" "$here" >"$work/build.log" 2>&1
cmp "$work"/dist/*.whl "$work"/again/*.whl
"$python" -m venv "$work/venv"
"$work/venv/bin/python" -m pip install --quiet --disable-pip-version-check \
    -c "$here/constraints.txt" "$work"/dist/*.whl
cd "$work"
for name in common services; do # folders of a user's, here and on PYTHONPATH
    mkdir $name && echo 'THEIRS = True' >$name/__init__.py
done
export PYTHONPATH="$work"
"$work/venv/bin/python" -c 'import common; assert common.THEIRS; from zenoh_vision import Node'
"$work/venv/bin/zv" --help >help.txt
grep -q camera help.txt
if [ "${ZV_WEIGHTS-yes}" ]; then
    "$work/venv/bin/zv" --version | grep -q LicenseRef-BSDS500-weights
    "$work/venv/bin/zv" edge --detector learned --image "$here/docs/images/edges/canny_1_smoothed.png" --out out.png
else
    "$work/venv/bin/zv" --version | grep -qx 'licence: Apache-2.0'
    ! "$work/venv/bin/zv" edge --detector learned 2>said.txt
    grep -q 'built without the weights of learned' said.txt
fi
free_port() {
    "$work/venv/bin/python" -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'
}
port=$(free_port)
ZV_VIEWER_PORT=$(free_port) \
    "$work/venv/bin/zv" up --plain --listen "tcp/127.0.0.1:$port" >out.txt 2>err.txt &
up=$!
status=0
"$work/venv/bin/python" "$here/tests/support/programs/first_centroid.py" "tcp/127.0.0.1:$port" || status=1
kill -INT "$up" || status=1 # it has ended by itself
wait "$up" || status=1
[ "$status" = 0 ] || { cat out.txt err.txt >&2; exit 1; }
echo "wheel: built, installed, and a system run from it"

#!/bin/sh
# Make the environment: setup.sh VENV UV_LOCK LOCK. Says first what the machine lacks, and how to get it.
set -eu
venv=$1 uv_lock=$2 lock=$3
python=${PYTHON:-python3}

missing=""
command -v "$python" >/dev/null 2>&1 || missing="$missing python3"
if [ -z "$missing" ]; then
    "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
        echo "vgyro needs Python 3.11 or newer; $python is $("$python" -V 2>&1). Name another with: make PYTHON=python3.12" >&2
        exit 1
    }
    "$python" -c 'import ensurepip, venv' 2>/dev/null || missing="$missing python3-venv"
    header=$("$python" -c 'import sysconfig; print(sysconfig.get_path("include") + "/Python.h")')
    [ -f "$header" ] || missing="$missing python3-dev"
fi
command -v cc >/dev/null 2>&1 || command -v gcc >/dev/null 2>&1 || missing="$missing gcc libc6-dev"
if [ -n "$missing" ]; then
    echo "vgyro needs packages that are not here. Install them with:  sudo apt-get install -y$missing" >&2
    exit 1
fi

# uv checks every hash and installs in seconds; pip, which takes minutes, only fetches uv.
[ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check --require-hashes -r "$uv_lock"
"$venv/bin/uv" pip sync --quiet --compile-bytecode --python "$venv/bin/python" --require-hashes "$lock"
"$venv/bin/uv" pip install --quiet --python "$venv/bin/python" --no-deps --no-build-isolation --editable .

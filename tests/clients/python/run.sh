#!/usr/bin/env bash
# run.sh install       installs the Python client into an environment of its own, as client/python/README.md says
# run.sh types         checks the types of the client and its examples
# run.sh unit|link|...   runs the test of that name with the installed client
#
# Exits with 77 (skipped) if a package is missing that deploy/setup.sh tests installs.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
work=$ROMAP_CLIENT_DIR/python
python=/usr/bin/python3

require_module() {
  for module in "$@"; do
    "$python" -c "import $module" 2>/dev/null || { echo "skipped: the Python module $module is missing; see deploy/setup.sh"; exit 77; }
  done
}

case $1 in
  install)
    require_module grpc google.protobuf numpy pip setuptools ensurepip wheel
    for tool in protoc grpc_python_plugin pkg-config; do
      command -v "$tool" >/dev/null || { echo "skipped: $tool is missing; see deploy/setup.sh"; exit 77; }
    done
    [ -f "$("$python" -c 'import sysconfig; print(sysconfig.get_path("include"))')/Python.h" ] ||
      { echo "skipped: the headers of Python are missing; see deploy/setup.sh"; exit 77; }
    rm -rf "$work"
    mkdir -p "$work/tree/client"
    # pip writes into the folder that it builds, so it gets a copy.
    cp -r "$ROMAP_SOURCE_DIR/client/python" "$work/tree/client/python"
    ln -s "$ROMAP_SOURCE_DIR/proto" "$ROMAP_SOURCE_DIR/common" "$work/tree"
    PATH=/usr/lib/ccache:$PATH  # Debian's ccache in the place of the compiler, if it is installed
    "$python" -m venv --system-site-packages "$work/env"
    "$work/env/bin/python" -m pip install --no-index --no-build-isolation "$work/tree/client/python"
    ;;
  types)
    require_module mypy
    cd "$ROMAP_SOURCE_DIR/client/python"
    exec "$python" -m mypy --cache-dir "$ROMAP_CLIENT_DIR/mypy" romap examples/*.py
    ;;
  *)
    [ -x "$work/env/bin/python" ] || { echo "skipped: the Python client is not installed"; exit 77; }
    exec "$work/env/bin/python" "$here/$1_test.py" --verbose
    ;;
esac

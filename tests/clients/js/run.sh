#!/usr/bin/env bash
# run.sh install       fetches the packages of the JavaScript client and packs it, as client/js/README.md says
# run.sh types         checks the types of the client
# run.sh unit|link|...   runs the test of that name
#
# Exits with 77 (skipped) without Node.js, and if the packages cannot be fetched because there is no network.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
work=$ROMAP_CLIENT_DIR/js

skip() { echo "skipped: $1"; exit 77; }
command -v node >/dev/null && command -v npm >/dev/null || skip "node or npm is missing; see deploy/setup.sh"
version=$(node -p 'process.versions.node.split(".")[0]')
[ "$version" -ge 18 ] || skip "Node.js 18 is required, not $version"

case $1 in
  install)
    mkdir -p "$work/romap"
    # npm writes beside package.json, so it gets a copy. Packages that are there already are not fetched again.
    cp -r "$ROMAP_SOURCE_DIR"/client/js/{package.json,package-lock.json,.npmrc,tsconfig.json,README.md} "$work/romap"
    rm -rf "$work/romap/src" "$work/proto" "$work/program"
    cp -r "$ROMAP_SOURCE_DIR/client/js/src" "$work/romap/src"
    mkdir "$work/program"
    ln -sfn "$ROMAP_SOURCE_DIR/proto" "$ROMAP_CLIENT_DIR/proto"
    cd "$work/romap"
    if ! cmp -s package-lock.json node_modules/of-package-lock.json; then
      npm ci --ignore-scripts --no-audit --no-fund --fetch-retries=1 >"$work/npm.log" 2>&1 || {
        cat "$work/npm.log"
        ! grep -qE 'ENOTFOUND|EAI_AGAIN|ECONNREFUSED|ECONNRESET|ETIMEDOUT|ENETUNREACH|E403|network' "$work/npm.log" ||
          skip "the packages cannot be fetched"
        exit 1
      }
      cp package-lock.json node_modules/of-package-lock.json
    fi
    # The packed client, as a program gets it.
    npm pack --pack-destination "$work/program" >"$work/pack.log" 2>&1 || { cat "$work/pack.log"; exit 1; }
    cd "$work/program"
    mkdir node_modules
    ln -s "$work"/romap/node_modules/* node_modules/
    tar -xzf romap-*.tgz
    mv package node_modules/romap
    ;;
  types)
    [ -d "$work/program/node_modules/romap" ] || skip "the JavaScript client is not installed"
    cd "$work/romap" && exec npm run --silent check
    ;;
  *)
    [ -d "$work/program/node_modules/romap" ] || skip "the JavaScript client is not installed"
    exec node --test "$here/$1.test.mjs"
    ;;
esac

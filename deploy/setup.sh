#!/usr/bin/env bash
# Installs the packages that romap needs to build, run and test on Debian 12, all from the distribution. Can be repeated
# safely: if all packages are installed, it changes nothing and needs no network.
#
#   deploy/setup.sh          the packages for the build
#   deploy/setup.sh tests    also the packages for the tests
#   deploy/setup.sh fuzz     also clang, for the fuzz targets
set -euo pipefail

packages=(
  ccache cmake g++ git ninja-build pkg-config
  libgrpc++-dev libgrpc-dev libprotobuf-dev protobuf-compiler protobuf-compiler-grpc libabsl-dev
  libopencv-dev libopencv-contrib-dev libeigen3-dev libceres-dev libhwy-dev libtbb-dev libnanoflann-dev
  libmeshoptimizer-dev libstb-dev libdraco-dev libexif-dev libjpeg62-turbo-dev libpng-dev libspdlog-dev libfmt-dev libyaml-cpp-dev
  libcli11-dev nlohmann-json3-dev libtinygltf-dev libtinyobjloader-dev libutfcpp-dev libsqlitecpp-dev libsqlite3-dev libxxhash-dev libsodium-dev libssl-dev libsystemd-dev libevent-dev prometheus-cpp-dev
)
if [ "${1:-}" = tests ] || [ "${1:-}" = fuzz ]; then
  packages+=(libgtest-dev libgmock-dev libbenchmark-dev libboost-context-dev chromium clang-format dpkg-dev file openssl
             python3-dev python3-grpcio python3-matplotlib python3-mypy python3-numpy python3-opencv python3-pip
             python3-protobuf python3-setuptools python3-venv python3-wheel)
fi
if [ "${1:-}" = fuzz ]; then
  packages+=(clang libclang-rt-14-dev)
fi
# For the page and the JavaScript client. Another Node.js than that of the distribution will do, too.
command -v node >/dev/null || packages+=(nodejs)
command -v npm >/dev/null || packages+=(npm)

missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
done
if [ ${#missing[@]} -eq 0 ]; then
  exit 0
fi

sudo=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "setup: root or sudo is required to install: ${missing[*]}" >&2; exit 1; }
  sudo=(sudo)
fi
echo "setup: installing ${#missing[@]} packages: ${missing[*]}"
log=$(mktemp)
if ! { "${sudo[@]}" apt-get update -q &&
       "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${missing[@]}"; } \
     >"$log" 2>&1; then
  tail -n 20 "$log" >&2
  echo "setup: apt-get failed (full log: $log)" >&2
  exit 1
fi
rm -f "$log"

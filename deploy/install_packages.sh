#!/usr/bin/env bash
# SPDX-License-Identifier: AGPL-3.0-or-later
# Installs the Debian packages that building, running and testing Vorocast needs (Debian 12). Does nothing when all are there.
set -euo pipefail

packages=(
  # tools
  build-essential cmake ninja-build ccache pkg-config git
  # messages
  libgrpc++-dev libprotobuf-dev protobuf-compiler protobuf-compiler-grpc libabsl-dev
  # geometry, kernels, physics, pictures
  libeigen3-dev libcgal-dev libtet1.5-dev libfftw3-dev libbullet-dev libembree-dev libtbb-dev libpng-dev libopenexr-dev libmurmurhash-dev libdraco-dev libnanoflann-dev libtinygltf-dev ffmpeg
  # storage and state
  libhdf5-dev libsqlite3-dev libpq-dev libssl-dev openssl
  # everyday libraries
  libspdlog-dev libfmt-dev libcli11-dev nlohmann-json3-dev prometheus-cpp-dev
  # peers that benchmarks measure beside
  voro++-dev libceres-dev
  # tests, benchmarks, checks
  postgresql postgresql-client slurmctld slurmd slurm-client munge libgtest-dev libgmock-dev python3 python3-h5py libassimp-dev clang-format-14 clang-tidy-14
)

missing=()
for package in "${packages[@]}"; do
  dpkg-query --show --showformat='${db:Status-Abbrev}' "$package" 2>/dev/null | grep -q '^ii' || missing+=("$package")
done
if [ ${#missing[@]} -eq 0 ]; then exit 0; fi

if ! command -v apt-get >/dev/null; then
  echo "install_packages.sh: this is no Debian; these packages are missing: ${missing[*]}" >&2
  exit 1
fi
as_root=()
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "install_packages.sh: run as root, or install sudo; missing packages: ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi
echo "Installing ${#missing[@]} Debian packages: ${missing[*]}"
"${as_root[@]}" apt-get update -q
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${missing[@]}"

#!/bin/sh
# Builds the image and tries it as a stranger would run it: user 1000, nothing else writable.
#
#   deploy/make_image.sh [NAME]        (BASE=… another base image, CPU=… another level of processor)
#
# By a Docker engine if one answers; else by buildah, which needs none (apt-get install buildah).
# Where no registry of images can be reached, a base is made of Debian's packages by mmdebstrap.
set -eu
cd "$(dirname "$0")/.."
NAME=${1:-lightleash}
# 880 MB are native libraries and their modules (LLVM, OpenCV, SciPy, FFmpeg twice), 180 the base.
MOST_MB=1150
CERTIFICATES=/etc/ssl/certs

say() { printf '\n== %s\n' "$*"; }

base_of_debian() {
    container=$(buildah from scratch)
    archive=$(mktemp --suffix=.tar)
    mmdebstrap --quiet --variant=minbase --include=python3,python3-venv,ca-certificates \
        --dpkgopt='path-exclude=/usr/share/man/*' --dpkgopt='path-exclude=/usr/share/doc/*' \
        --dpkgopt='path-exclude=/usr/share/locale/*' bookworm "$archive"
    buildah add --quiet "$container" "$archive" /
    rm "$archive"
    buildah commit --quiet --rm "$container" lightleash-base
}

if docker info >/dev/null 2>&1; then
    say "docker build"
    docker build --file deploy/Dockerfile ${BASE:+--build-arg "BASE=$BASE"} ${CPU+--build-arg "CPU=$CPU"} --tag "$NAME" .
    bytes=$(docker image inspect --format '{{.Size}}' "$NAME")
    try() { docker run --rm --read-only --tmpfs /tmp "$NAME" "$@"; }
elif command -v buildah >/dev/null; then
    export BUILDAH_ISOLATION=chroot STORAGE_DRIVER=vfs
    if [ -z "${BASE:-}" ] && ! buildah pull --quiet python:3.11-slim-bookworm >/dev/null 2>&1; then
        say "no registry of images answers: a base of Debian's packages"
        BASE=localhost/lightleash-base
        buildah inspect "$BASE" >/dev/null 2>&1 || base_of_debian
    fi
    say "buildah bud"
    # The builder's authorities: a network may have one of its own.
    buildah bud --file deploy/Dockerfile --format docker --ignorefile .dockerignore --quiet \
        --volume "$CERTIFICATES:$CERTIFICATES:ro" \
        ${BASE:+--build-arg "BASE=$BASE"} ${CPU+--build-arg "CPU=$CPU"} \
        ${PIP_CERT:+--env "PIP_CERT=$PIP_CERT"} --tag "$NAME" .
    container=$(buildah from --pull-never "$NAME")
    trap 'buildah rm "$container" >/dev/null' EXIT
    root=$(buildah mount "$container")
    bytes=$(du --summarize --block-size=1 "$root" | cut --fields=1)
    # User 1000 may write its state and /tmp alone: to it the root is read-only.
    try() { buildah run --user 1000 "$container" -- lightleash "$@"; }
else
    echo "neither a Docker engine nor buildah is here: apt-get install buildah mmdebstrap" >&2
    exit 1
fi

say "what it finds of itself (doctor)"
try doctor
say "what it compiles (warm: nothing, it came with all)"
try warm
megabytes=$((bytes / 1000000))
say "$NAME: $megabytes MB, at most $MOST_MB"
[ "$megabytes" -le "$MOST_MB" ]

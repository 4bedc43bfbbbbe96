#!/bin/sh
# Sets everything up and serves: installs missing Debian packages, builds Release, starts the daemon on the demo scene,
# prints the URL and a first curl. Arguments go to silvistad: deploy/run.sh --scene my/scene.json --listen 127.0.0.1:9000
set -eu
here=$(cd "$(dirname "$0")/.." && pwd)
"$here/deploy/install-packages.sh"
build=${SILVISTA_BUILD:-$here/build}
cmake -S "$here" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSV_TESTS=OFF >"$here/build.log" 2>&1 ||
    { cat "$here/build.log" >&2; exit 1; }
ninja -C "$build" >"$here/build.log" 2>&1 || { tail -n 40 "$here/build.log" >&2; exit 1; }
rm -f "$here/build.log"

scene=$here/deploy/demo/scene.json
for argument in "$@"; do
    case $argument in
    --scene | --scene=* | --config | --config=* | --render | --render=* | --help | --version | --check-config | --print-config)
        scene= ;;
    esac
done
[ -z "${SILVISTA_SCENE:-}" ] || scene=
if [ -n "$scene" ]; then
    [ $# -gt 0 ] || echo "first picture: curl -o view.jpg 'http://127.0.0.1:8080/v1/view?x=1180&y=620&agl=34&heading=335&pitch=-9'"
    set -- --scene "$scene" "$@"
fi
exec "$build/server/silvistad" "$@"

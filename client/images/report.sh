#!/bin/sh
# Draws client/images/report.png: the page that `planish unwrap --report` writes about Spot, in chromium. With MESHES, files or
# directories, draws client/images/sheet.png instead: the contact sheet of a batch of them.
#   client/images/report.sh BIN_DIR [MESH...]
set -eu
here=$(cd "$(dirname "$0")" && pwd)
planish=$(cd "$1" && pwd)/planish
shift
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
picture=report
if [ $# -eq 0 ]; then
  "$planish" unwrap "$here/../../tests/data/spot_seam.obj" -o "$work/flat.obj" --report="$work/report.html" --progress=none
else
  picture=sheet
  "$planish" unwrap "$@" -o "$work/flat/" --report="$work/sheet.html" --progress=none || true # a broken file is shown too
fi
# Drawn without a graphics card; the time is virtual, and enough for the page to settle.
chromium --headless --no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader --hide-scrollbars \
  --window-size=1280,800 --virtual-time-budget=5000 --screenshot="$here/$picture.png" "file://$work/$picture.html"

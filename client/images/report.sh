#!/bin/sh
# Draws client/images/report.png: the page that `planish unwrap --report` writes about Spot, in chromium.
#   client/images/report.sh BIN_DIR
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$1/planish" unwrap "$here/../../tests/data/spot_seam.obj" -o "$work/flat.obj" --report="$work/spot.html" --progress=none
# Drawn without a graphics card; the time is virtual, and enough for the page to settle.
chromium --headless --no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader --hide-scrollbars \
  --window-size=1280,800 --virtual-time-budget=5000 --screenshot="$here/report.png" "file://$work/spot.html"

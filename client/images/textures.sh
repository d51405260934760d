#!/bin/sh
# Draws client/images/merge.jpg and bake.jpg: pages of `planish unwrap --report` with textures, in chromium.
#   client/images/textures.sh BIN_DIR
set -eu
here=$(cd "$(dirname "$0")" && pwd)
planish=$(cd "$1" && pwd)/planish
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
node "$here/scenes.mjs" "$work"
"$planish" unwrap "$work/merge.glb" -o "$work/merge_out.glb" --merge-materials --report="$work/merge.html" --progress=none
"$planish" unwrap "$work/bake.ply" -o "$work/bake_out.glb" --bake=colors --report="$work/bake.html" --progress=none
for picture in merge bake; do
  # Drawn without a graphics card; the time is virtual, and enough for the page to settle.
  chromium --headless --no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader --hide-scrollbars \
    --window-size=1280,860 --virtual-time-budget=5000 --screenshot="$work/$picture.png" "file://$work/$picture.html#textured"
  convert "$work/$picture.png" -crop 860x776+0+84 +repage -quality 88 "$here/$picture.jpg"
done

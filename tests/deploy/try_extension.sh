#!/bin/bash
# Tries the extension of Blender in a fresh tree of Debian 13, whose Blender (4.3) has neither planish nor grpcio: it is valid, is installed, runs the ten
# lines of client/blender/README.md, and is removed again. Takes minutes, and so is no part of ctest.
#
#   tests/deploy/try_extension.sh [DIST] [TREES]      see try/trees.sh
# shellcheck disable=SC2016  # text for shells inside
set -euo pipefail
# shellcheck source=tests/deploy/try/trees.sh
source "$(dirname "${BASH_SOURCE[0]}")/try/trees.sh"

extension=$(echo "$dist"/planish_blender-*-linux-*.zip)
step "$(basename "$extension"): Debian trixie"
fresh_tree trixie blender
inside apt-get -qq update
install blender python3-numpy
inside sh -c '! command -v planish planishd && ! python3 -c "import grpc" 2>/dev/null'
inside blender --version | head -n 1
cp "$extension" "$tree/tmp/extension.zip"
sed -n '/^```python$/,/^```$/p' "$source_tree/client/blender/README.md" | grep -v '^```' >"$tree/tmp/ten.py"
inside blender --command extension validate /tmp/extension.zip
inside blender --command extension install-file -r user_default -e /tmp/extension.zip
inside blender --background --python-exit-code 1 --python /tmp/ten.py | tee "$work/said"
grep -q FINISHED "$work/said"
inside blender --command extension remove planish_blender
left=$(inside find /root -path '*planish*')
[ -z "$left" ] || fail "left behind: $left"
echo "All that was tried works."

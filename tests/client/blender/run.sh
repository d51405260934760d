#!/bin/sh
# Runs tests in Blender, with settings and add-ons of their own. 77: there is no Blender.
#
#   run.sh TEST.py [CASE...]
set -eu
command -v blender >/dev/null || {
  echo "no blender in PATH"
  exit 77
}
directory=$(mktemp -d)
trap 'rm -rf "$directory"' EXIT
mkdir "$directory/tmp"
export BLENDER_USER_SCRIPTS="$directory/scripts" BLENDER_USER_CONFIG="$directory/config" TMPDIR="$directory/tmp"
unset XDG_RUNTIME_DIR
blender --background --factory-startup --python-exit-code 1 --python "$1" -- "$@"

#!/bin/sh
# Runs tests in Blender, with settings and add-ons of their own. 77: there is no Blender.
#
#   run.sh TEST.py
set -eu
command -v blender >/dev/null || {
  echo "no blender in PATH"
  exit 77
}
directory=$(mktemp -d)
trap 'rm -rf "$directory"' EXIT
export BLENDER_USER_SCRIPTS="$directory/scripts" BLENDER_USER_CONFIG="$directory/config"
blender --background --factory-startup --python-exit-code 1 --python "$1"

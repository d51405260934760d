#!/bin/sh
# Builds the pages anew and compares them with those in the repository. Exit code 77: skipped, and why is printed.
#   template.sh WORK_DIR SOURCES
set -eu
here=$(cd "$(dirname "$0")" && pwd)

# shellcheck source=tests/npm/packages.sh
. "$here/../npm/packages.sh"
install_packages "$2" "$1"
rm -rf src dist
cp -r "$2/src" "$2/index.html" "$2/sheet.html" "$2/tsconfig.json" "$2/vite.config.js" .
npm run build >build.log 2>&1 || {
  cat build.log
  exit 1
}
for page in template.html sheet_template.html; do
  cmp "$page" "$2/$page" || {
    echo "client/report/$page is not what its sources make; run npm ci && npm run build in client/report"
    exit 1
  }
done

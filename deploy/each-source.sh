#!/bin/sh
# Checks that each source of the product compiles alone, without the project's precompiled headers: it includes what it
# uses. clang-14 parses it (-fsyntax-only), which takes two thirds of GCC's time and finds code that only clang refuses.
# Builds only the generated headers, in build/clang. Prints the compiler's messages and the number of sources.
#
#   deploy/each-source.sh [PATTERN]     PATTERN, a regular expression, chooses sources by path
set -eu
cd "$(dirname "$0")/.."

deploy/install-packages.sh build clang
mkdir -p build
cmake --preset clang -DPLANISH_BUILD_TESTS=OFF -DCMAKE_EXPORT_COMPILE_COMMANDS=ON >build/configure-clang.log 2>&1 || {
  cat build/configure-clang.log >&2
  exit 1
}
cmake --build --preset clang --target planish_proto_sources planish_made_sources >&2
exec python3 deploy/each-source.py build/clang/compile_commands.json "$@"

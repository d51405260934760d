#!/bin/sh
# Checks that each source of the product compiles alone, without precompiled headers: it includes what it uses. clang-14
# parses it (-fsyntax-only), which takes two thirds of GCC's time and finds code that only clang refuses. Builds only
# the generated headers, in build/clang. Prints the compiler's messages and the number of sources.
set -eu
cd "$(dirname "$0")/.."

deploy/install-packages.sh build clang
mkdir -p build
cmake --preset clang -DPLANISH_BUILD_TESTS=OFF -DCMAKE_EXPORT_COMPILE_COMMANDS=ON >build/configure-clang.log 2>&1 || {
  cat build/configure-clang.log >&2
  exit 1
}
cmake --build --preset clang --target planish_proto_sources planish_made_sources >&2

cd build/clang
# One line for each source: the shell command that CMake wrote. Generated sources are left out.
sed -n -e '/\/proto\/gen\//d' -e 's/^ *"command": "\(.*\)",$/\1 -fsyntax-only/p' compile_commands.json | sed 's/\\\(["\\]\)/\1/g' >sources
[ -s sources ] || {
  echo "each-source: no commands in $PWD/compile_commands.json" >&2
  exit 1
}
tr '\n' '\0' <sources | xargs -0 -P "$(nproc)" -n 1 sh -c || {
  echo "each-source: a source does not compile alone, see above" >&2
  exit 1
}
echo "$(wc -l <sources) sources compile alone"

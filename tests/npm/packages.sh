# shellcheck shell=sh
# For scripts of tests that need packages of npm; they source it.

# Ends the test as skipped: 77 is what ctest is told to look for.
skip() {
  echo "SKIPPED: $*"
  exit 77
}

# Copies files into the current directory. Each comes in one step, since another test may be reading the one that is there.
#   put FILE...
put() {
  for file in "$@"; do
    cp "$file" "$(basename "$file").$$" && mv "$(basename "$file").$$" "$(basename "$file")" || exit
  done
}

# Copies package.json and package-lock.json of a directory into another one, makes that the current one and installs
# what they name, unless it is there.
#   install_packages FROM INTO
install_packages() {
  command -v node >/dev/null || skip "node is not installed (18 or newer is needed)"
  command -v npm >/dev/null || skip "npm is not installed"
  [ "$(node -p 'process.versions.node.split(".")[0]')" -ge 18 ] || skip "node $(node --version) is older than 18"
  mkdir -p "$2"
  cd "$2" || exit
  put "$1"/package.json "$1"/package-lock.json
  if cmp -s package-lock.json node_modules/.installed-lock; then return; fi
  if ! npm ci --ignore-scripts --no-audit --no-fund --prefer-offline --fetch-retries=1 >npm.log 2>&1; then
    cat npm.log
    # What is wrong with the lock file or the packages is a failure; a registry that does not answer is not.
    ! grep -Eq 'code (EUSAGE|EINTEGRITY|EJSONPARSE|ERESOLVE)' npm.log || exit 1
    skip "npm could not fetch the packages"
  fi
  cp package-lock.json node_modules/.installed-lock
}

#!/bin/bash
# What is in which package, and the directory of the relocatable tarball: that its programs find each other and their libraries wherever it is.
#
#   packages.sh BUILD SOURCE WORK
set -euo pipefail
build=$1 source=$2 work=$3
rm -rf "$work"
mkdir -p "$work"
fail() {
  echo "FAILED: $*"
  exit 1
}
files() { (cd "$1" && find . -type f -o -type l | sed 's/^\.//' | sort); }
has() { # PACKAGE PATTERN...: the files of a package are these and no others
  local package=$1 pattern
  shift
  DESTDIR=$work/$package cmake --install "$build" --component "$package" --prefix /usr >/dev/null
  files "$work/$package" >"$work/left"
  for pattern in "$@"; do
    grep -qE "^$pattern\$" "$work/left" || fail "$package has no $pattern"
    grep -vE "^$pattern\$" "$work/left" >"$work/rest" || true
    mv "$work/rest" "$work/left"
  done
  [ ! -s "$work/left" ] || fail "$package also has: $(cat "$work/left")"
}

has planish /usr/bin/planish /usr/share/man/man1/planish.1 '/usr/share/(bash-completion|zsh|fish)/.*/_?planish(\.fish)?' /usr/share/doc/planish/copyright
has planishd '/usr/bin/planishd(-farm)?' /usr/lib/systemd/system/planishd.service /etc/planish/planishd.yaml \
  /usr/share/man/man8/planishd.8 '/usr/share/(bash-completion|zsh|fish)/.*/_?planishd(\.fish)?' /usr/share/doc/planishd/copyright
has libplanish '/usr/lib/.*libplanish\.so\.[0-9.]+' '/usr/share/doc/libplanish[0-9]+/copyright'
has libplanish-dev '/usr/lib/.*libplanish\.so' '/usr/include/planish/[a-z_]+\.h' '/usr/lib/.*cmake/planish/[a-z-]+\.cmake' \
  '/usr/lib/.*pkgconfig/planish\.pc' '/usr/share/planish/proto/.*\.proto' /usr/share/doc/libplanish-dev/copyright
has python3-planish '/usr/lib/python3/dist-packages/planish/.*\.pyi?' '/usr/lib/python3/dist-packages/planish/py\.typed' \
  '/usr/lib/python3/dist-packages/planish-[0-9.]+\.dist-info/[A-Za-z_.]+' /usr/share/planish/planish_blender.zip \
  /usr/share/doc/python3-planish/copyright

# A plain `cmake --install` has nothing that is in no package, but for the unit and the configuration of machines without packages.
cmake --install "$build" --prefix "$work/prefix" >/dev/null
files "$work/prefix" | sed 's#^#/usr#' | grep -v '^/usr/share/planish/systemd/' >"$work/all"
for package in planish planishd libplanish libplanish-dev; do files "$work/$package"; done | sort >"$work/packaged"
[ -z "$(comm -23 "$work/all" "$work/packaged")" ] || fail "in no package: $(comm -23 "$work/all" "$work/packaged")"

# The unit is the sandboxed one, with the user that the package makes.
unit=$work/planishd/usr/lib/systemd/system/planishd.service
[ "$(grep -cxE 'User=planish|Group=planish|ExecStart=/usr/bin/planishd .*' "$unit")" = 3 ] || fail "the unit is not that of the package"
! grep -qE '^DynamicUser|cmake' "$unit" || fail "the unit is not that of the package"
diff <(grep -vE '^(#|DynamicUser=|ExecStart=)' "$source/deploy/systemd/planishd.service") \
  <(grep -vE '^(#|User=|Group=|ExecStart=)' "$unit") || fail "the units differ in more than the user"
for script in "$source"/deploy/packages/*/p*; do sh -n "$script"; done

# Nothing but the numbered namespace is visible.
library=$(find "$work/libplanish" -name 'libplanish.so.*' -type f)
exported=$(nm -DC --defined-only "$library" | cut -d ' ' -f 3-)
grep -q '^planish::abi[0-9]*::Client::Unwrap(' <<<"$exported" || fail "$library has no Client::Unwrap"
others=$(grep -vE '^((vtable|typeinfo|typeinfo name) for )?planish::abi[0-9]+::|^PLANISH_[0-9]+' <<<"$exported" || true)
[ -z "$others" ] || fail "also visible in $library: $others"
readelf -d "$library" | grep -qE "SONAME.*libplanish\.so\.$(sed -n 's/^set(PLANISH_ABI \([0-9]*\))/\1/p' "$source/CMakeLists.txt")\]" || fail "its soname"

# The tarball's directory. A thing in it that is missing would be taken from this machine: the loader says what it took.
"$source/deploy/relocatable.sh" "$build" "$work/prefix" "$work/made"
mv "$work/made" "$work/moved"
ln -s moved/bin/planish "$work/link"
version=$(PATH=/nowhere "$work/link" version)
[[ $version = *"($work/moved/bin/planishd;"* ]] || fail "planish does not find planishd: $version"
foreign=$(LD_DEBUG=libs "$work/moved/bin/planishd-farm" --version 2>&1 | sed -n 's/.*calling init: //p' | grep -v "^$work/moved/lib" || true)
[ -z "$foreign" ] || fail "libraries of this machine: $foreign"
# Nor do those that others want loaded into every program: they need another C library.
echo 'extern "C" void _exit(int); __attribute__((constructor)) static void f() { _exit(9); }' | c++ -shared -fPIC -x c++ - -o "$work/preload.so"
LD_PRELOAD=$work/preload.so "$work/link" version >/dev/null || fail "LD_PRELOAD gets in the way"
env -u PLANISHD PATH=/nowhere "$work/link" unwrap "$source/tests/data/spot_seam.obj" -o "$work/out.obj" --progress=none
grep -q '^vt ' "$work/out.obj" || fail "no UV"
[ -s "$work/moved/share/doc/libraries/libc6/copyright" ] || fail "the tarball lacks licences"

# The wheel with the server, unpacked as Blender does that, without modes: its programs run all the same. Only they and their libraries are in it.
"$source/deploy/relocatable.sh" "$build" "$work/prefix" "$work/root" planish planishd
[ ! -e "$work/root/libexec/planishd-farm" ] && [ ! -e "$work/root/lib/libpq.so.5" ] || fail "the wheel has more than it needs"
/usr/bin/python3 "$source/client/python/build_package.py" server "$build"/client/python/dist/planish-*-none-any.whl "$work/root" "$work"
wheel=$(echo "$work"/planish-*-py3-none-manylinux_2_17_*.whl)
[ "$(stat -c %s "$wheel")" -lt 35000000 ] || fail "the wheel has more than 35 MB"
/usr/bin/python3 - "$wheel" "$work/site" "$source" "$work" <<'END'
import base64, csv, hashlib, importlib.util, io, os, pathlib, re, subprocess, sys, zipfile

path, site, source, work = sys.argv[1:]
with zipfile.ZipFile(path) as wheel:
    wheel.extractall(site)
    names = {entry.filename: entry.external_attr >> 16 for entry in wheel.infolist()}
    (info,) = {name.split("/")[0] for name in names if ".dist-info/" in name}
    for name, digest, size in csv.reader(io.StringIO(wheel.read(f"{info}/RECORD").decode())):
        mode = names.pop(name)
        if digest:
            content = wheel.read(name)
            assert (f"sha256={base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b'=').decode()}", str(len(content))) == (digest, size), name
            assert bool(mode & 0o111) == (re.search(r"/(bin|libexec|scripts)/|/lib/(loader|libc\.so\.6)$", name) is not None), name
    assert not names, names  # each file is in the record, by which pip removes it
    assert f"Tag: {os.path.basename(path)[:-4].split('-', 2)[2]}\n" in wheel.read(f"{info}/WHEEL").decode()
# Each library belongs to a package, and the licence of each package is there; the longer texts that they name too.
docs = pathlib.Path(site, "planish/_server/share/doc")
packages = [line.split("\t")[0] for line in (docs / "libraries/PACKAGES").read_text().splitlines() if "\t" in line]
assert {"libc6", "libgrpc29", "libprotobuf32", "libssl3"} <= set(packages), packages
for package in [*packages, "libeigen3-dev", "nlohmann-json3-dev"]:
    text = (docs / "libraries" / package / "copyright").read_text(errors="replace")
    for name in re.findall(r"/usr/share/common-licenses/([A-Za-z0-9.-]*[A-Za-z0-9])", text):
        assert not os.path.exists("/usr/share/common-licenses/" + name) or (docs / "libraries/common-licenses" / name).exists(), name
assert "three.js" in (docs / "planish/three.js.LICENSE").read_text()

code = f"""if True:
    import sys
    sys.path.insert(0, {site!r})
    import planish
    assert planish.find_planishd() == {site!r} + "/planish/_server/bin/planishd", planish.find_planishd()
    assert planish.unwrap([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).is_usable
"""
environment = {"PATH": "/nowhere"}
# The command without gRPC for Python, as the extension of Blender uses it where it brings none.
sys.path[:0] = [site, source + "/client/blender/planish_blender"]
engines = importlib.import_module("engines")
command = engines._own_command()
assert command == site + "/planish/_server/bin/planish", command
subprocess.run([command, "unwrap", source + "/tests/data/spot_seam.obj", "-o", work + "/wheel.obj", "--quiet"], check=True, env=environment)
subprocess.run([sys.executable, "-I", "-B", "-c", code], check=True, env=environment)
script = pathlib.Path(site, info.replace("dist-info", "data"), "scripts/planish")
said = subprocess.run([sys.executable, script, "version"], env={**environment, "PYTHONPATH": site}, check=True, stdout=subprocess.PIPE, text=True).stdout
assert f"({site}/planish/_server/bin/planishd;" in said, said

# The extension of Blender: its manifest names what is in it.
extension = os.path.join(work, "extension.zip")
subprocess.run([sys.executable, source + "/client/blender/build_addon.py", "extension", extension, "1.2.3", source + "/LICENSE", "linux-x64", path], check=True)
with zipfile.ZipFile(extension) as archive:
    manifest = archive.read("blender_manifest.toml").decode()
    assert 'version = "1.2.3"' in manifest and 'platforms = ["linux-x64"]' in manifest and "[permissions]" in manifest
    # Blender allows 64 characters.
    assert all(len(text) <= 64 for text in re.findall(r'^(?:tagline|network|files) = "(.*)"$', manifest, re.MULTILINE)), manifest
    assert {name[2:] for name in re.findall(r'"(\./wheels/[^"]*)"', manifest)} == {name for name in archive.namelist() if name.startswith("wheels/")}
    assert {"__init__.py", "engines.py", "LICENSE"} <= set(archive.namelist())
END

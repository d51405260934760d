#!/bin/sh
# Assembles the root directory of the image: the programs, and from Debian only the libraries that they load
# (deploy/libraries.sh) and the certificates of public authorities. No shell, no package manager.
#
#   deploy/image-root.sh PREFIX ROOT      PREFIX: where cmake --install installed planish
set -eu
root=$2
"${0%/*}/libraries.sh" "$1" "$root"

install -d -m 1777 "$root/tmp"
mkdir -p "$root/etc/ssl/certs"
cp -L /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/"
cp /etc/debian_version "$root/etc/debian_version"
cp -L /etc/os-release "$root/etc/os-release"
echo 'planish:x:10001:10001::/nonexistent:/usr/sbin/nologin' >"$root/etc/passwd"
echo 'planish:x:10001:' >"$root/etc/group"
install -d -m 700 -o 10001 -g 10001 "$root/var/lib/planish"

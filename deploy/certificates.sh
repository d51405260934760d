#!/bin/sh
# Makes the files to try TLS, client certificates and tokens: a certificate authority, a certificate for the server, one
# for a client, a random token, and an access file with the client's certificate and the token.
#
#   deploy/certificates.sh DIR [HOST...]
#
# HOST: names and addresses by which clients reach the server [localhost 127.0.0.1 ::1]. Existing files in DIR do not
# change, so the command may be repeated, and makes files again that were removed. Certificates are valid for 825 days,
# the authority for ten years. For a farm, let your own authority sign the certificates: ca-key.pem is all it takes to
# impersonate anybody.
#
#   planishd --listen=0.0.0.0:7741 --tls-cert=DIR/server.pem --tls-key=DIR/server-key.pem --access-file=DIR/access.yaml
#   planish unwrap MESH -o OUT --server=HOST:7741 --tls-ca=DIR/ca.pem --token-file=DIR/token
#
# With --tls-client-ca=DIR/ca.pem the server also requires a client certificate; then the client adds
#   --tls-cert=DIR/client.pem --tls-key=DIR/client-key.pem
set -eu

fail() {
  echo "certificates: $*" >&2
  exit 1
}

[ $# -ge 1 ] || fail "usage: $0 DIR [HOST...]"
case $1 in -*) fail "usage: $0 DIR [HOST...]" ;; esac
command -v openssl >/dev/null || fail "openssl is not installed"
dir=$1
shift
[ $# -gt 0 ] || set -- localhost 127.0.0.1 ::1

days=825
client_name=planish-client
umask 077
if [ ! -d "$dir" ]; then
  mkdir -p "$dir"
  chmod 750 "$dir"
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Prints openssl's output only if it fails.
quietly() {
  "$@" 2>"$work/log" >&2 || {
    cat "$work/log" >&2
    fail "$1 $2 failed"
  }
}

# Moves a complete file into place and reports it. The group may read files of the server: in a container the server
# runs as another user, who is a member of that group (docker run --group-add).
keep() {
  case $1 in
    server.pem | server-key.pem | ca.pem | access.yaml) chmod 640 "$work/new" ;;
    *) chmod 600 "$work/new" ;;
  esac
  mv "$work/new" "$dir/$1"
  echo "made $dir/$1" >&2
}

new_key() {
  [ -s "$dir/$1" ] && return
  quietly openssl genpkey -algorithm EC -pkeyopt ec_paramgen_curve:P-256 -out "$work/new"
  keep "$1"
}

# new_certificate NAME COMMON-NAME USAGE SUBJECT-ALTERNATIVE-NAMES
new_certificate() {
  new_key "$1-key.pem"
  [ -s "$dir/$1.pem" ] && return
  printf '%s\n' "basicConstraints=critical,CA:FALSE" "keyUsage=critical,digitalSignature" "extendedKeyUsage=$3" \
    "subjectAltName=$4" >"$work/extensions"
  quietly openssl req -new -key "$dir/$1-key.pem" -subj "/CN=$2" -out "$work/request"
  quietly openssl x509 -req -in "$work/request" -CA "$dir/ca.pem" -CAkey "$dir/ca-key.pem" -days "$days" \
    -set_serial "0x$(openssl rand -hex 16)" -extfile "$work/extensions" -out "$work/new"
  keep "$1.pem"
}

new_key ca-key.pem
if [ ! -s "$dir/ca.pem" ]; then
  quietly openssl req -x509 -new -key "$dir/ca-key.pem" -days 3650 -subj "/CN=planish test authority" \
    -addext "basicConstraints=critical,CA:TRUE" -addext "keyUsage=critical,keyCertSign,cRLSign" -out "$work/new"
  keep ca.pem
fi

names=
for host in "$@"; do
  case $host in
    *[!0-9A-Za-z.:_*-]* | "") fail "no host: $host" ;;
    *:* | *[0-9].[0-9]*.[0-9]*.[0-9]*) kind=IP ;;
    *) kind=DNS ;;
  esac
  names=$names${names:+,}$kind:$host
done
new_certificate server "$1" serverAuth "$names"
new_certificate client "$client_name" clientAuth "DNS:$client_name"

if [ ! -s "$dir/token" ]; then
  openssl rand -hex 32 >"$work/new"
  keep token
fi
if [ ! -s "$dir/access.yaml" ]; then
  digest=$(tr -d '\n' <"$dir/token" | openssl dgst -sha256 -r | cut -d ' ' -f 1)
  {
    echo "# Who may use a planishd, see server/access/access_file.h. Tokens are here by their SHA-256 only."
    echo "tenants:"
    echo "  trial:"
    echo "    credentials:"
    echo "      - token-sha256: \"$digest\""
    echo "        name: trial"
    echo "        rights: [submit, jobs, admin]"
    echo "      - certificate: $client_name"
  } >"$work/new"
  keep access.yaml
fi

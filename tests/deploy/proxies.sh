#!/bin/sh
# Two fronts and a worker behind a proxy with the configuration of deploy/proxy, on loopback and with TLS on both sides.
# Exit code 77: skipped, and why is printed.
#   proxies.sh haproxy|nginx BIN_DIR SOURCE_DIR WORK_DIR
set -eu
proxy=$1
bin=$2
source=$3
work=$4

skip() {
  echo "SKIPPED: $*"
  exit 77
}
export PATH="$PATH:/usr/sbin"
command -v "$proxy" >/dev/null || skip "$proxy is not installed"
command -v openssl >/dev/null || skip "openssl is not installed"
postgres=/usr/lib/postgresql/15/bin
[ -x "$postgres/postgres" ] || skip "PostgreSQL is not installed"
rm -rf "$work"
mkdir -p "$work"
cd "$work"

pids=
database=$(mktemp -d)  # a socket's name must be short
trap 'for pid in $pids; do kill -9 "$pid" 2>/dev/null || true; done; rm -rf "$database"' EXIT
fail() {
  echo "FAILED: $*"
  for log in *.log; do
    echo "---- $log"
    tail -n 30 "$log"
  done
  exit 1
}
# Sets $1 to a port that nobody has now, that was not given out before, and that the kernel gives to nobody: it is below
# the range from which connections get theirs.
given=" "
port() {
  left=20
  while :; do
    found=$(shuf -i 10000-30000 -n 1)
    case $given in *" $found "*) continue ;; esac
    : >port.txt  # what is read below must not be of the one before
    "$bin/planishd" --listen=127.0.0.1:"$found" --isolation=thread >port.txt 2>&1 &
    probe=$!
    until grep -q "listens on 127" port.txt || ! kill -0 $probe 2>/dev/null; do sleep 0.05; done
    kill $probe 2>/dev/null || true
    wait $probe || true
    ! grep -q "listens on 127" port.txt || break
    left=$((left - 1))
    [ $left -gt 0 ] || fail "no port: $(cat port.txt)"
  done
  given="$given$found "
  eval "$1=$found"
}
# until_ok SECONDS COMMAND...
until_ok() {
  left=$(($1 * 10))
  shift
  until "$@" >/dev/null 2>&1; do
    left=$((left - 1))
    [ $left -gt 0 ] || fail "never: $*"
    sleep 0.1
  done
}

# Certificates for the names in the configuration, as the servers' and the proxy's own.
"$source/deploy/certificates.sh" tls planishd localhost 127.0.0.1 2>/dev/null
cat tls/server.pem tls/server-key.pem >tls/planish.pem
for name in front grpc0 grpc1 http0 http1; do port $name; done
# Nobody but this script uses it, and it need not outlive it.
as=
if [ "$(id -u)" = 0 ]; then
  chown postgres "$database"
  as="setpriv --reuid=postgres --regid=postgres --clear-groups"
fi
(cd / && $as "$postgres/initdb" -D "$database/data" -U planish --auth=trust --no-sync >"$work/initdb.log" 2>&1) || fail initdb
(cd / && exec $as setpriv --pdeathsig=QUIT "$postgres/postgres" -D "$database/data" -k "$database" -c listen_addresses= \
  -c fsync=off >"$work/postgres.log" 2>&1) &
pids="$pids $!"
until_ok 60 "$postgres/pg_isready" -h "$database" -U planish -d postgres
store="postgresql://planish@/postgres?host=$database"
serve() {
  eval "listen=\$grpc$1 metrics=\$http$1"
  "$bin/planishd" --role=front --store="$store" --listen="127.0.0.1:$listen" --metrics-listen="127.0.0.1:$metrics" \
    --access-file=tls/access.yaml --tls-cert=tls/server.pem --tls-key=tls/server-key.pem --tls-client-ca=tls/ca.pem \
    --tls-client-auth=request --reattach-grace=30 >>"server$1.log" 2>&1 &
  eval "server$1=$!"
  pids="$pids $!"
  until_ok 60 "$bin/planish" health "http://127.0.0.1:$metrics/readyz"
}
serve 0
serve 1
"$bin/planishd" --role=worker --store="$store" --workers=1 --threads=1 --access-file=tls/access.yaml >>worker.log 2>&1 &
pids="$pids $!"

# The configuration as it is, with other addresses and files.
case $proxy in
haproxy)
  sed -E "s#/etc/haproxy/tls#$work/tls#g; s#bind :7741#bind 127.0.0.1:$front#
    s#front-0:7741#127.0.0.1:$grpc0#; s#front-1:7741#127.0.0.1:$grpc1#
    s#(127.0.0.1:$grpc0 .*) port 9741#\1 port $http0#; s#(127.0.0.1:$grpc1 .*) port 9741#\1 port $http1#" \
    "$source/deploy/proxy/haproxy.cfg" >haproxy.cfg
  haproxy -c -f haproxy.cfg >check.log 2>&1 || fail "HAProxy does not take its configuration"
  haproxy -db -f haproxy.cfg >proxy.log 2>&1 &
  pids="$pids $!"
  ;;
nginx)
  sed -E "s#/etc/nginx/tls/tls.crt#$work/tls/server.pem#; s#/etc/nginx/tls/tls.key#$work/tls/server-key.pem#
    s#/etc/nginx/tls/ca.crt#$work/tls/ca.pem#; s#listen 7741#listen 127.0.0.1:$front#
    s#front-0.example:7741#127.0.0.1:$grpc0#; s#front-1.example:7741#127.0.0.1:$grpc1#
    s#access_log .*#access_log $work/proxy.log; client_body_temp_path b; proxy_temp_path p; fastcgi_temp_path f; uwsgi_temp_path u; scgi_temp_path s;#
    s#^worker_processes auto;#daemon off; master_process off; pid $work/nginx.pid;#" \
    "$source/deploy/proxy/nginx.conf" >nginx.conf
  nginx -p "$work" -e error.log -t -c "$work/nginx.conf" >check.log 2>&1 || fail "nginx does not take its configuration"
  nginx -p "$work" -e error.log -c "$work/nginx.conf" >stderr.log 2>&1 &
  pids="$pids $!"
  ;;
esac
export PLANISH_SERVER="localhost:$front" PLANISH_TLS_CA="$work/tls/ca.pem" PLANISH_TOKEN_FILE="$work/tls/token"
until_ok 60 "$bin/planish" version
planish() {
  "$bin/planish" "$@" 2>>client.log
}
spot=$source/tests/data/spot_seam.obj

# Jobs until each front got one that was made after this call; their names go into jobs.txt.
jobs_of() { grep -c QUEUED "server$1.log" || true; }
jobs_to_both() {
  : >jobs.txt
  before0=$(jobs_of 0) before1=$(jobs_of 1) made=0
  until [ "$(jobs_of 0)" -gt "$before0" ] && [ "$(jobs_of 1)" -gt "$before1" ]; do
    [ $made -lt 40 ] || fail "a front got none of $made jobs"
    planish unwrap "$spot" --detach --fresh --seams=none >>jobs.txt || fail "a job through the proxy"
    made=$((made + 1))
  done
}

# Calls go to both, and any front answers those about any job.
jobs_to_both
while read -r job; do
  [ "$(planish jobs show "$job" --json | grep -c "\"$job\"")" -ge 1 ] || fail "jobs show $job"
done <jobs.txt
while read -r job; do planish jobs watch "$job" --mesh "$spot" -o watched.obj >/dev/null || fail "jobs watch $job"; done <jobs.txt
planish jobs list --json >list.json || fail "jobs list"
[ "$(grep -o 'jobs/[0-9a-f]*' list.json | sort -u | wc -l)" -eq "$(wc -l <jobs.txt)" ] || fail "a list is of the farm: $(cat list.json)"
if planish jobs show jobs/0123456789abcdef; then fail "there is no such job"; fi
grep -q JOB_NOT_FOUND client.log || fail "the fronts' own answers do not come through"

# A mesh that travels by an upload of several messages, 4 MiB and more, and the job that is made from it.
awk 'BEGIN {
  n = 580
  for (i = 0; i <= n; ++i) for (j = 0; j <= n; ++j) printf "v %d %d %.3f\n", i, j, sin(i * j)
  for (i = 0; i < n; ++i) for (j = 1; j <= n; ++j) {
    a = i * (n + 1) + j; b = a + n + 1
    printf "f %d %d %d\nf %d %d %d\n", a, b, a + 1, b, b + 1, a + 1
  } }' >large.obj
job=$(planish unwrap large.obj --detach --seams=none) || fail "the large mesh"
planish jobs cancel "$job" >/dev/null || fail "jobs cancel $job"

# A front that is killed while somebody waits for a job through it: the client goes on at the other one.
"$bin/planish" unwrap "$spot" -o attached.obj --fresh --max-stretch=1.02 --progress=json 2>events.txt >/dev/null &
client=$!
until_ok 60 grep -q '"job": *"jobs/' events.txt
job=$(sed -n 's#.*"\(jobs/[0-9a-f]*\)".*#\1#p' events.txt | head -n 1)
victim=0
grep -q "$job QUEUED" server1.log && victim=1
eval "kill -9 \$server$victim"
eval "wait \$server$victim" || true
wait $client || fail "the client did not go on at the other front: $(tail -n 3 events.txt)"
cmp -s attached.obj "$spot" && fail "no UV came"
serve "$victim"

# One that drains: new jobs go to the other.
if [ "$proxy" = haproxy ]; then
  jobs_to_both  # the one that was killed too
  lines=$(wc -l <proxy.log)
  is_down() { tail -n +$((lines + 1)) proxy.log | grep -q 'fronts/front-0 is DOWN'; }
  "$bin/planish" admin drain --server="localhost:$grpc0" 2>>client.log >/dev/null || fail "admin drain"
  until_ok 60 is_down
  for i in 1 2 3; do planish unwrap "$spot" --detach --seams=none >>after.txt || fail "a job while one drains"; done
fi
echo ok

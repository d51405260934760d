#!/bin/sh
# Two servers behind a proxy with the configuration of deploy/proxy, on loopback and with TLS on both sides. Exit code 77:
# skipped, and why is printed.
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
rm -rf "$work"
mkdir -p "$work"
cd "$work"

pids=
trap 'for pid in $pids; do kill -9 "$pid" 2>/dev/null || true; done' EXIT
fail() {
  echo "FAILED: $*"
  for log in *.log; do
    echo "---- $log"
    tail -n 30 "$log"
  done
  exit 1
}
# Sets $1 to a port that nobody has now, and that was not given out before.
given=" "
port() {
  while :; do
    : >port.txt  # what is read below must not be the one before
    "$bin/planishd" --listen=127.0.0.1:0 --isolation=thread >port.txt 2>&1 &
    probe=$!
    until grep -q "listens on 127" port.txt; do kill -0 $probe || fail "no port"; sleep 0.05; done
    kill $probe
    wait $probe || true
    found=$(sed -n 's/.*listens on 127.0.0.1:\([0-9]*\).*/\1/p' port.txt)
    case $given in *" $found "*) ;; *) break ;; esac
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
serve() {
  eval "listen=\$grpc$1 metrics=\$http$1"
  "$bin/planishd" --instance="planishd-$1" --listen="127.0.0.1:$listen" --metrics-listen="127.0.0.1:$metrics" \
    --data-dir="data$1" --workers=1 --threads=1 --access-file=tls/access.yaml --tls-cert=tls/server.pem \
    --tls-key=tls/server-key.pem --tls-client-ca=tls/ca.pem --tls-client-auth=request --reattach-grace=30 \
    >>"server$1.log" 2>&1 &
  eval "server$1=$!"
  pids="$pids $!"
  until_ok 20 "$bin/planish" health "http://127.0.0.1:$metrics/readyz"
}
mkdir data0 data1
serve 0
serve 1

# The configuration as it is, with other addresses and files.
case $proxy in
haproxy)
  sed -E "s#/etc/haproxy/tls#$work/tls#g; s#bind :7741#bind 127.0.0.1:$front#
    s#planishd-0.planishd:7741#127.0.0.1:$grpc0#; s#planishd-1.planishd:7741#127.0.0.1:$grpc1#
    s#(127.0.0.1:$grpc0 .*) port 9741#\1 port $http0#; s#(127.0.0.1:$grpc1 .*) port 9741#\1 port $http1#
    s#ca-file [^ ]*/ca.crt#ca-file $work/tls/ca.pem#" "$source/deploy/proxy/haproxy.cfg" >haproxy.cfg
  haproxy -c -f haproxy.cfg >check.log 2>&1 || fail "HAProxy does not take its configuration"
  # That of Kubernetes can be read at least.
  cp tls/ca.pem tls/ca.crt
  sed "s#/etc/haproxy/tls#$work/tls#g" "$source/deploy/kubernetes/overlays/farm/haproxy.cfg" >farm.cfg
  haproxy -c -f farm.cfg >check.log 2>&1 || fail "HAProxy does not take the configuration of the farm"
  haproxy -db -f haproxy.cfg >proxy.log 2>&1 &
  pids="$pids $!"
  ;;
nginx)
  sed -E "s#/etc/nginx/tls/tls.crt#$work/tls/server.pem#; s#/etc/nginx/tls/tls.key#$work/tls/server-key.pem#
    s#/etc/nginx/tls/ca.crt#$work/tls/ca.pem#; s#listen 7741#listen 127.0.0.1:$front#
    s#planishd-0.planishd:7741#127.0.0.1:$grpc0#; s#planishd-1.planishd:7741#127.0.0.1:$grpc1#
    s#access_log .*#access_log $work/proxy.log; client_body_temp_path b; proxy_temp_path p; fastcgi_temp_path f; uwsgi_temp_path u; scgi_temp_path s;#
    s#^worker_processes auto;#daemon off; master_process off; pid $work/nginx.pid;#" \
    "$source/deploy/proxy/nginx.conf" >nginx.conf
  nginx -p "$work" -e error.log -t -c "$work/nginx.conf" >check.log 2>&1 || fail "nginx does not take its configuration"
  nginx -p "$work" -e error.log -c "$work/nginx.conf" >stderr.log 2>&1 &
  pids="$pids $!"
  ;;
esac
export PLANISH_SERVER="localhost:$front" PLANISH_TLS_CA="$work/tls/ca.pem" PLANISH_TOKEN_FILE="$work/tls/token"
until_ok 20 "$bin/planish" version
planish() {
  "$bin/planish" "$@" 2>>client.log
}
spot=$source/tests/data/spot_seam.obj

# Jobs go to both, and calls about each to its own.
for i in 1 2 3 4; do planish unwrap "$spot" --detach --fresh --seams=none >>jobs.txt; done
grep -q '^jobs/planishd-0\.' jobs.txt || fail "no job on the first server"
grep -q '^jobs/planishd-1\.' jobs.txt || fail "no job on the second server"
while read -r job; do
  [ "$(planish jobs show "$job" --json | grep -c "\"$job\"")" -ge 1 ] || fail "jobs show $job"
done <jobs.txt
while read -r job; do planish jobs watch "$job" --mesh "$spot" -o watched.obj >/dev/null || fail "jobs watch $job"; done <jobs.txt
planish jobs list --json >list.json || fail "jobs list"
[ "$(grep -o 'jobs/planishd-[01]' list.json | sort -u | wc -l)" -eq 1 ] || fail "a list is of one server: $(cat list.json)"
if planish jobs show jobs/planishd-0.0123456789abcdef; then fail "there is no such job"; fi
if planish jobs show jobs/nobody.0123456789abcdef; then fail "there is no such server"; fi
grep -q JOB_NOT_FOUND client.log || fail "the servers' own answers do not come through"

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

# A server that is killed with a job that somebody waits for, and started anew: the client re-attaches through the proxy.
"$bin/planish" unwrap "$spot" -o attached.obj --fresh --max-stretch=1.02 --progress=json 2>events.txt >/dev/null &
client=$!
until_ok 20 grep -q '"job": *"jobs/planishd-[01]' events.txt
victim=$(sed -n 's#.*jobs/planishd-\([01]\)\..*#\1#p' events.txt | head -n 1)
eval "kill -9 \$server$victim"
eval "wait \$server$victim" || true
serve "$victim"
wait $client || fail "the client did not re-attach to planishd-$victim: $(tail -n 3 events.txt)"
cmp -s attached.obj "$spot" && fail "no UV came"
grep -q "jobs/planishd-$victim" events.txt

# One that drains: new jobs go to the other, and those that it has can be asked for.
if [ "$proxy" = haproxy ]; then
  job=$(sed -n '/planishd-0/{p;q;}' jobs.txt)
  "$bin/planish" admin drain --server="localhost:$grpc0" 2>>client.log >/dev/null || fail "admin drain"
  until_ok 10 grep -q 'planish-any/planishd-0 is DOWN' proxy.log
  for i in 1 2 3; do planish unwrap "$spot" --detach --seams=none >>after.txt || fail "a job while one drains"; done
  ! grep -q planishd-0 after.txt || fail "a new job went to the server that drains"
  planish jobs show "$job" >/dev/null || fail "jobs of a server that drains cannot be asked for"
fi
echo ok

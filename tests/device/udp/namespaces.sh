#!/usr/bin/env bash
# namespaces.sh CONTROLLER FAR_HOST: host and controller at the two sites of a network (tests/dds/namespaces.sh), which delays and
# loses frames: UDP over the real stack of the system, ARP included.
set -euo pipefail
controller=$1 far_host=$2

at_site 2 "$controller" --listen 10.77.0.2:0 --device 'sim:?encoder=ideal' > "$NET_FOLDER/said" &
until [ -s "$NET_FOLDER/said" ]; do sleep 0.02; done
port=$(sed -n '1s/.*10\.77\.0\.2:\([0-9]*\) .*/\1/p' "$NET_FOLDER/said")

# try WAY_MS JITTER_MS LOSS, each way
try() {
  net "delay $1e-3" "jitter $2e-3" "loss $3"
  at_site 1 "$far_host" "fidel:udp:10.77.0.2:$port" "$1" "$3"
}
try 0 0 0
try 5 2 0.1
try 20 0 0

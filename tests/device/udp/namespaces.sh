#!/usr/bin/env bash
# namespaces.sh CONTROLLER FAR_HOST FRAME_RELAY: host and controller in network namespaces of their own, each with a network card, and
# between the cards a relay of frames that delays and loses them: UDP over the real stack of the system, ARP included. Without
# privileges. Ends with 77 where the system refuses namespaces, or has no `ip`.
set -euo pipefail

if [ "${1-}" != --inside ]; then
  if ! command -v ip unshare nsenter > /dev/null || ! unshare -Urn ip link add name fsa type veth peer name fsb 2> /dev/null; then
    echo "not tested: network namespaces with veths are not available here"
    exit 77
  fi
  exec unshare -Urn --kill-child --fork --pid --mount-proc bash "$0" --inside "$@"
fi
shift
controller=$1 far_host=$2 relay=$3

# Each is a process that does nothing but hold a namespace. The PID namespace ends with this script, and all in it.
unshare -n sleep infinity &
host_side=$!
unshare -n sleep infinity &
controller_side=$!
inside() { nsenter -t "$1" -n "${@:2}"; }
for side in "$host_side" "$controller_side"; do
  until [ "$(readlink "/proc/$side/ns/net")" != "$(readlink /proc/$$/ns/net)" ]; do sleep 0.02; done
done

ip link add name fsh0 type veth peer name fsh1
ip link add name fsc0 type veth peer name fsc1
ip link set fsh0 netns "$host_side"
ip link set fsc0 netns "$controller_side"
ip link set fsh1 up
ip link set fsc1 up
set_up() {  # PID INTERFACE ADDRESS
  inside "$1" ip addr add "$3/24" dev "$2"
  inside "$1" ip link set lo up
  inside "$1" ip link set "$2" up
  inside "$1" "$relay" --checksums "$2"
}
set_up "$host_side" fsh0 10.77.0.1
set_up "$controller_side" fsc0 10.77.0.2

folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT
inside "$controller_side" "$controller" --listen 10.77.0.2:0 --device 'sim:?encoder=ideal' > "$folder/said" &
until [ -s "$folder/said" ]; do sleep 0.02; done
port=$(sed -n '1s/.*10\.77\.0\.2:\([0-9]*\) .*/\1/p' "$folder/said")

# try WAY_MS JITTER_MS LOSS, each way
try() {
  "$relay" fsh1 fsc1 "$1" "$2" "$3" 1 &
  local relaying=$!
  inside "$host_side" "$far_host" "fidel:udp:10.77.0.2:$port" "$1" "$3"
  kill "$relaying"
  wait "$relaying" 2> /dev/null || true
}
try 0 0 0
try 5 2 0.1
try 20 0 0

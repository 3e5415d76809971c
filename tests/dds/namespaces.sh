#!/usr/bin/env bash
# namespaces.sh RELAY N COMMAND...: a network of N machines, the sites 1 to N, for a command and what it starts. Each site is a
# network namespace with a network card, eth0, of the address 10.77.0.SITE, a loopback and the host name siteSITE; so it also has
# abstract sockets of its own, as the servers "shm:NAME" have. A relay of frames (RELAY is net_relay) joins the sites as a switch
# that can be told to be a bad one. Without privileges. Files and processes are common to all sites, and all processes end with
# the command, whose exit status this has. It ends with 77, before all, where the system refuses namespaces, or has no `ip`.
#
# For the command there are two more, also in the folder NET_FOLDER/bin:
#   at_site SITE COMMAND...    becomes that command at that site, so $! of `at_site ... &` is its process
#   net COMMAND...             tells the relay such as "delay 0.010", "loss 0.02 1-2" or "cut 2", and prints its answers, such
#                              as of "counts": see net_relay.cpp
# and in the environment: NET_SITES (N), NET_PIDS (processes that hold the namespaces, for nsenter -t PID -n -u), NET_SOCKET (the
# relay's) and NET_FOLDER, which has nothing but these and goes at the end.
#
# Options by the environment: NET_SEED (1); NET_CLOCKS=apart: the monotonic clock of site 2 is 1000 s ahead of that of site 1,
# that of site 3 2000 s, and so on (nsenter: also -T), as machines have different ones.
set -euo pipefail

if [ "${1-}" != --inside ]; then
  if [ $# -lt 3 ] || ! [[ $2 =~ ^[1-9][0-9]?$ ]]; then
    echo "usage: namespaces.sh RELAY N COMMAND..." >&2
    exit 2
  fi
  refused() {
    echo "not tested: $1 not available here"
    exit 77
  }
  for tool in ip unshare nsenter setpriv; do
    command -v "$tool" > /dev/null || refused "the program $tool is"
  done
  unshare -Urn --fork --pid --mount-proc unshare -n -u ip link add name fsa type veth peer name fsb 2> /dev/null ||
    refused "network namespaces with veths are"
  if [ "${NET_CLOCKS-}" = apart ]; then
    unshare -UrT --monotonic 1 true 2> /dev/null || refused "time namespaces are"
  fi
  # unshare itself ignores what asks it to end, and bash has what it starts so ignore Ctrl-C.
  NET_FOLDER=$(mktemp -d)
  export NET_FOLDER
  trap '{ kill -KILL "$network" && wait "$network"; } 2> /dev/null || true; rm -rf "$NET_FOLDER"' EXIT
  trap 'exit 143' TERM HUP
  trap 'exit 130' INT
  setpriv --pdeathsig KILL env --default-signal=INT,QUIT unshare -Urn --kill-child --fork --pid --mount-proc bash "$0" \
    --inside "$@" <&0 &
  network=$!
  status=0
  wait "$network" || status=$?
  exit "$status"
fi
shift
relay=$(realpath "$1") NET_SITES=$2
shift 2
NET_SOCKET=$NET_FOLDER/relay

# For each site a process that does nothing but hold its namespaces. The PID namespace ends with this script, and all in it.
hold=(-n -u) pids=()
for ((site = 1; site <= NET_SITES; ++site)); do
  apart=()
  if [ "${NET_CLOCKS-}" = apart ]; then
    apart=(-T --monotonic $((1000 * (site - 1))))
  fi
  unshare "${hold[@]}" "${apart[@]}" sh -c 'hostname "$1" && : > "$2" && exec sleep infinity' - "site$site" \
    "$NET_FOLDER/ready$site" &
  pids+=($!)
done
NET_PIDS=${pids[*]}
[ "${NET_CLOCKS-}" != apart ] || hold+=(-T)

mkdir "$NET_FOLDER/bin"
cat > "$NET_FOLDER/bin/at_site" << END
#!/usr/bin/env bash
pids=(no $NET_PIDS)
exec nsenter -t "\${pids[\$1]}" ${hold[@]} -- "\${@:2}"
END
cat > "$NET_FOLDER/bin/net" << END
#!/bin/sh
exec "$relay" --tell "$NET_SOCKET" "\$@"
END
chmod +x "$NET_FOLDER"/bin/*
export NET_SITES NET_PIDS NET_SOCKET PATH=$NET_FOLDER/bin:$PATH

# No addresses of IPv6: the system would speak by itself.
ends=()
for ((site = 1; site <= NET_SITES; ++site)); do
  until [ -e "$NET_FOLDER/ready$site" ]; do sleep 0.01; done
  rm "$NET_FOLDER/ready$site"
  end=site$site
  ip link add name "$end" type veth peer name eth0 netns "${pids[site - 1]}"
  ip link set "$end" addrgenmode none
  ip link set "$end" up
  at_site "$site" sh -c 'ip link set lo up && ip link set eth0 addrgenmode none && ip addr add "$1/24" brd + dev eth0 &&
    "$2" --checksums eth0 && ip link set eth0 up' - "10.77.0.$site" "$relay"
  ends+=("$end")
done
"$relay" "$NET_SOCKET" "${NET_SEED:-1}" "${ends[@]}" &
net  # it is there

"$@"

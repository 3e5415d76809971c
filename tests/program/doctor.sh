#!/usr/bin/env bash
# doctor.sh PROGRAM REFUSE_CALLS: what forceserver doctor says of this machine, and of machines on which something is wrong. How late a
# servo is depends on the machine, so it may count as wrong everywhere.
set -uo pipefail
program=$1 refuse_calls=$2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
chmod 755 "$folder"
cd "$folder" || exit 1
name=doctor-$$
failures=0
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}
# expect STATUS PATTERN COMMAND...: as in program.sh.
expect() {
  local wanted=$1 pattern=$2 status
  shift 2
  timeout 60 "$@" > output 2>&1 < /dev/null
  status=$?
  if [[ $status != $wanted ]] || ! grep -qE -e "$pattern" output; then
    echo "FAILED: $*: ended with $status, expected $wanted and /$pattern/ in:"
    sed 's/^/    /' output
    failures=$((failures + 1))
  fi
}
also() {  # PATTERN: the same output has this line, too
  grep -qE -e "$1" output || { fail "no line matches /$1/ in:"; sed 's/^/    /' output; }
}
doctor=("$program" doctor --seconds 0.1)
sanitized=no
[[ $(ldd "$program") != *lib[at]san* ]] || sanitized=yes

# The whole page.
expect '[01]' '^verdict: ' "${doctor[@]}"
status=$(timeout 60 "${doctor[@]}" > page; echo $?)
[ "$(grep '^#' page | head -8 | tr '\n' ';')" = \
  "# forceserver doctor;## Version;## Machine;## Real time;## Devices;## Servers;## Limits;## Lateness;" ] || fail "the sections are others"
[ "$(tail -1 page | grep -c '^verdict: ')" = 1 ] || fail "the verdict is not the last line"
wrong=$(grep -c '^WRONG ' page)
[ "$wrong" = "$(sed -nE 's/^verdict: ([0-9]+) things? (is|are) wrong.*/\1/p' page | grep . || echo 0)" ] || fail "the verdict counts otherwise"
[ "$status" = "$((wrong > 0))" ] || fail "with $wrong things wrong it ends with $status"
[ "$(grep -cE '^(WRONG|better) ' page)" = "$(grep -c '^  cure  .' page)" ] || fail "something that is wrong has no cure"
version=$("$program" --version | cut -d ' ' -f 2)
grep -E '^    program ' page | grep -qF " $version at $(realpath "$program")" || fail "the page does not tell the program"
grep -qE '^    servo +late p50 [0-9]+ us, p99 [0-9]+ us, max [0-9]+ us$' page || fail "the page does not tell how late a servo is"
grep -qE '^    idle thread +late p50 [0-9]+ us, p99 [0-9]+ us, max [0-9]+ us ' page || fail "the page has no idle thread"
grep -qE '^    devices +sim:' page || fail "the page does not tell the devices"
grep -q 'not known: .*not known' page && fail "the page says twice that something is not known"

if command -v python3 > /dev/null; then
  "${doctor[@]}" --json > page.json
  python3 -c "
import json
d = json.load(open('page.json'))
assert list(d) == ['version', 'machine', 'real_time', 'devices', 'servers', 'limits', 'lateness', 'wrong', 'better', 'verdict'], list(d)
assert d['lateness']['measured'] == 0.1
assert 'sim:' in d['devices']['devices'] and type(d['real_time']['sched_fifo']) is bool and d['limits']['descriptors'] > 0
for late in d['lateness']['servo'], d['lateness']['idle_thread']:
    assert 0 <= late['late_p50'] <= late['late_p99'] <= late['late_max'] < 60, late
assert 'sim' in [driver['scheme'] for driver in d['devices']['drivers']]
assert all(found['sentence'] and found['cure'] for found in d['wrong'] + d['better'])
" || fail "doctor --json is not as expected"
fi
expect 2 '^forceserver: .*seconds' "$program" doctor --seconds 0
expect 2 '^forceserver: .*seconds' "$program" doctor --seconds 11
expect 2 "^forceserver: doctor takes no 'lab'$" "$program" doctor lab
expect 2 '^forceserver: doctor has no option --jsn; did you mean --json\?$' "$program" doctor --jsn
expect 2 '^forceserver: cannot write: ' sh -c '"$@" > /dev/full' sh "${doctor[@]}"

# Servers that run here; the name of another's could hold commands for a terminal.
for option in "" --all-users; do
  : > served  # what the server before has said
  "$program" run --listen "$name" $option > served 2>&1 < /dev/null &
  server=$!
  for _ in $(seq 100); do
    grep -q '^listens at ' served && break
    sleep 0.1
  done
  expect '[01]' "^ .* $name: user $(id -un), process $server \(forceserver\)${option:+, for all users}$" "${doctor[@]}"
  [ "$(grep -c "$name: " output)" = 1 ] || fail "a server is told twice"
  kill -INT $server
  wait $server
done
if command -v python3 > /dev/null; then
  cat > evil.py << 'END'
import socket, subprocess, sys
evil = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
evil.bind("\0forceserver/" + sys.argv[1] + "\x1b[2J")
evil.listen()
sys.exit(subprocess.run(sys.argv[2:]).returncode)
END
  expect '[01]' "$name\?\[2J: user " python3 evil.py "$name" "${doctor[@]}"
  grep -q $'\e' output && fail "a name of somebody's server reaches the terminal as it is"
fi

# No real-time priority and no locked memory: what to write where.
bare=(prlimit --memlock=0 --rtprio=0 --)
[ "$(id -u)" != 0 ] || bare+=(setpriv --bounding-set=-all --inh-caps=-all)
locked=', locked memory, '
[ $sanitized = no ] || locked=  # a sanitizer locks no memory, and says that it did
expect 1 "^WRONG   the system refuses a servo a real-time priority, .*$locked" "${bare[@]}" "${doctor[@]}"
also "^ .*printf '%s.n' '$(id -un) - rtprio 90' '$(id -un) - memlock unlimited' \| sudo tee /etc/security/limits.d/forceserver-$(id -un).conf$"
also '; the unit of a service says instead: LimitRTPRIO=90, LimitMEMLOCK=infinity$'
also '^    granted +(none|nice)$'

# The rule of udev: where it is not installed, it is copied from a place that there is; a program that is alone says who has it.
copies() { sed -nE "s/^    udev rule +not installed; .* sudo cp (.*) \/etc\/udev.*/\1/p" "$1"; }
if ! grep -qE '^    udev rule +/' page; then
  eval "rule=$(copies page)"
  [ -f "$rule" ] || fail "the rule is to be copied from '$rule', which is not there"
  mkdir -p alone/bin
  cp "$program" alone/bin
  expect '[01]' '^    udev rule +not installed; .* which the package forceserver and .* have, into /etc/udev/rules.d; then: sudo udevadm' \
    alone/bin/forceserver doctor --seconds 0.1
  mkdir -p alone/lib/udev/rules.d
  touch alone/lib/udev/rules.d/60-forceserver.rules
  expect '[01]' "^    udev rule .*sudo cp $folder/alone/lib/udev/rules.d/60-forceserver.rules /etc" alone/bin/forceserver doctor --seconds 0.1
fi

(ulimit -n 100; exec "${doctor[@]}" > few 2>&1)
grep -q '^better  a process may open only 100 files' few || fail "doctor does not see that a process may open few files"

# Devices on the USB, here an imitated one.
if command -v umockdev-run > /dev/null && [ $sanitized = no ] && ! ldconfig -p | grep -q 'libdrd\.so\.3'; then
  printf '%s\n' "P: /devices/bus/usb/1-3" "N: bus/usb/001/003" "E: SUBSYSTEM=usb" "E: DEVTYPE=usb_device" "A: busnum=1" "A: devnum=3" \
    "A: idVendor=1451" "A: idProduct=0402" "A: product=omega.3" "A: serial=S3" "" > bus.umockdev
  expect 1 '^WRONG   usb 1451:0402, device of Force Dimension, serial S3 .*: it needs the driver dhd, which cannot be used' \
    umockdev-run -d bus.umockdev -- "${doctor[@]}"
  also '^  cure  the page device/dhd/README.md says what this device needs'
fi

# A filter of system calls.
if "$refuse_calls" EPERM memfd_create true; then
  expect 1 '^WRONG   the system refuses memfd_create, without which no server can be started' \
    "$refuse_calls" EPERM memfd_create,pidfd_open "${doctor[@]}"
  also '^    end of processes +pidfd_open is refused: Operation not permitted$'
  also '^better  the system refuses pidfd_open'
  also '^  cure  .*seccomp'
  if [ $sanitized = no ]; then  # a sanitizer itself needs a thread
    expect 1 '^WRONG   a servo cannot be started: ' "$refuse_calls" EPERM clone "${doctor[@]}"
    also '^  cure  cure what else is wrong first; if that is nothing, send this page in a report$'
  fi
fi

# Machines that are imitated in a name space of one's own, in which everybody is root. within SETUP: the page of a machine that
# these lines of the shell arrange.
unshare=(unshare --mount)
[ "$(id -u)" = 0 ] || unshare+=(--map-root-user)
within() {
  echo "mount --make-rprivate / || exit 77; $1" > setup
  # shellcheck disable=SC2016  # of the inner shell
  "${unshare[@]}" sh -c '. ./setup; exec "$@"' sh "${doctor[@]}" > output 2>&1 < /dev/null
}
if "${unshare[@]}" sh -c 'mount --make-rprivate / && mount -t tmpfs none /mnt' 2> /dev/null; then
  if [ $sanitized = no ]; then  # a sanitizer itself needs /proc
    within 'mount -t tmpfs none /proc'
    also '^    processor +not known: /proc/cpuinfo: '
    also '^    not known +/proc/net/unix cannot be read$'
    also '^verdict: '
  fi
  within 'touch null && mount --bind /dev/null null && mount -t tmpfs none /dev && touch /dev/null && mount --bind null /dev/null'
  also '^    /dev/shm +not there: No such file or directory; forceserver does without$'
  within 'mount -t tmpfs none /run && mkdir -p /run/user/0 &&
    python3 -c "import socket; socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET).bind(\"/run/user/0/.forceserver-old\")"'
  also "^better  a server that was killed has left /run/user/0/.forceserver-old; "
  also "^  cure  rm '/run/user/0/.forceserver-old'$"
  # Control groups of version 2: the limit of the outer group counts, as less is left there.
  within 'mount -t tmpfs none /sys/fs/cgroup && mkdir -p /sys/fs/cgroup/outer/inner && cd /sys/fs/cgroup/outer &&
    echo 100000000 > memory.max && echo 90000000 > memory.current && echo "50000 100000" > cpu.max &&
    echo 900000000 > inner/memory.max && echo 9000000 > inner/memory.current && echo "max 100000" > inner/cpu.max &&
    echo 0::/outer/inner > /sys/fs/cgroup/own && mount --bind /sys/fs/cgroup/own /proc/$$/cgroup; cd "$OLDPWD"'
  also '^    memory +limited to 100 MB by a control group, of which 10 MB are left$'
  also '^    processor time +limited to 0.5 processors by a control group$'
  also '^WRONG   a control group leaves 10 MB of memory'
  also '^better  a control group limits the time to 0.5 processors'
  within 'mount -t tmpfs none /sys/devices/system/cpu && mkdir -p /sys/devices/system/cpu/cpufreq/policy0 &&
    echo powersave > /sys/devices/system/cpu/cpufreq/policy0/scaling_governor'
  also '^    governor +powersave$'
  also '^  cure  sudo cpupower frequency-set -g performance$'
  within 'mkdir -p limits && mount --bind limits /etc/security/limits.d && touch "limits/forceserver-$(id -un).conf"
    set -- prlimit --memlock=0 --rtprio=0 -- setpriv --bounding-set=-all --inh-caps=-all "$@"'
  also '/etc/security/limits.d/forceserver-.*.conf is there: log out and in again, until .prlimit --pid \$\$ --rtprio. says 90\.'
  also 'the line .session required pam_limits.so. in its file in /etc/pam.d$'
  also '^ +the unit of a service says instead: LimitRTPRIO=90, LimitMEMLOCK=infinity$'
  grep -q 'sudo tee' output && fail "the command that was of no help is told again"
  within 'mount -t tmpfs none /run && mkdir -p /run/udev/rules.d && touch /run/udev/rules.d/60-forceserver.rules'
  also '^    udev rule +(/etc|/run)/udev/rules.d/60-forceserver.rules$'
  if [ "$(id -u)" = 0 ] && setpriv --reuid=4242 test -x "$program" 2> /dev/null; then
    expect '[01]' '^better  this user has no home: ' setpriv --reuid=4242 --regid=4242 --clear-groups env -u HOME -u XDG_CONFIG_HOME "${doctor[@]}"
    also '^    home +none: neither XDG_CONFIG_HOME nor HOME is set'
  fi
  if [ ! -e /.dockerenv ]; then  # a file that cannot be read makes no container
    within 'mount -t tmpfs none /run && mkdir /run/systemd &&
      python3 -c "import socket; socket.socket(socket.AF_UNIX).bind(\"/run/systemd/container\")"; unset container
      set -- prlimit --memlock=0 --rtprio=0 -- setpriv --bounding-set=-all --inh-caps=-all "$@"'
    also '^    container +not known: /run/systemd/container: '
    also '^  cure  printf'
    grep -q 'start the container' output && fail "a container that is not known counts as one"
  fi
else
  echo "machines that are imitated: not tried, there is no name space"
fi

# A folder of calibrations that belongs to root, as after a first sudo, within one of the user.
if [ "$(id -u)" = 0 ] && setpriv --reuid=4242 test -x "$program" 2> /dev/null; then
  mkdir -p config/forceserver
  chown 4242 config
  expect '[01]' "^better  calibrations are kept in $folder/config/forceserver, which this user may not write to$" \
    setpriv --reuid=4242 --regid=4242 --clear-groups env XDG_CONFIG_HOME="$folder/config" "${doctor[@]}"
  also '^  cure  export XDG_CONFIG_HOME=FOLDER, '
fi

echo "$failures failures"
[ $failures = 0 ]

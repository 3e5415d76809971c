#!/usr/bin/env bash
# program.sh PROGRAM SCENE LOSING_DRIVER STOP_FORCE CALIBRATED_DRIVER TROUBLED_DRIVER: tests the command line of forceserver as a user sees it.
set -uo pipefail
program=$1 scene=$2 losing_driver=$3 stop_force=$4 calibrated_driver=$5 troubled_driver=$6
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
failures=0

# expect STATUS PATTERN COMMAND...: the command must end with this exit status (a pattern of the shell), and its output on both streams must
# match this regular expression. What a machine that is busy with other things has kept from its ticks is run again.
expect() {
  local wanted=$1 pattern=$2 status
  shift 2
  for _ in $(seq 5); do
    "$@" > output 2>&1 < "${input:-/dev/null}"
    status=$?
    grep -q 'the servo was late too long' output || break
  done
  if [[ $status != $wanted ]] || ! grep -qE -e "$pattern" output; then
    echo "FAILED: $*: ended with $status, expected $wanted and /$pattern/ in:"
    sed 's/^/    /' output
    failures=$((failures + 1))
  fi
}
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}
until_says() {  # PATTERN COMMAND...: again and again, until a line of its output matches
  local pattern=$1
  shift
  for _ in $(seq 300); do
    "$@" 2>&1 | grep -qE "$pattern" && return
    sleep 0.1
  done
  fail "$* does not say $pattern"
}

# Help, version and wrong command lines.
expect 0 '^forceserver [0-9]+\.[0-9]+\.[0-9]+$' "$program" --version
expect 0 'examples:' "$program" run --help
expect 0 'Exit status' "$program" --help

expect 2 '^forceserver: a command is missing; there are: run, .*, hello-device; see: forceserver --help$' "$program"
# An option is not taken for the value of another.
expect 2 '^forceserver: --listen: its value is missing: --locked is an option$' "$program" run --listen --locked
expect 2 '^forceserver: --record: its value is missing: --force-limit is an option$' "$program" run --record --force-limit 3
[ -w /dev/full ] && expect 2 '^forceserver: cannot write: ' sh -c "\"\$0\" check '$scene' > /dev/full" "$program"

# A number option says of what is no number within its bound, NaN too, which bound it has.
refused_number() {  # WORD BOUND COMMAND... OPTION
  expect 2 "^forceserver: ${*: -1}: $1 is not a number $2\$" "$program" "${@:3}" "$1"
}
for word in nan -nan x; do
  refused_number $word 'above 0' run --duration
  refused_number $word 'above 0' run --rate
  refused_number $word 'above 0' run --force-limit
  refused_number $word 'above 0' run --listen lab --client-force
  refused_number $word 'above 0' check a.stl --scale
  refused_number $word 'above 0' test-device sim: --push
  refused_number $word 'of 0 or more' evaluate a.json --time
  refused_number $word 'of 0 or more' test-device sim: --wait
  refused_number $word 'of 0 or more' hello-device sim: --wait
  refused_number $word 'from 0.01 to 86400' watch lab --interval
  refused_number $word 'from 0.1 to 10' doctor --seconds
  refused_number $word 'from 0.5 to 3600' test-device sim: --seconds
  refused_number $word 'from 0.1 to 3' hello-device sim: --force
done
refused_number 10.1 'from 0.1 to 10' doctor --seconds
refused_number 0.09 'from 0.1 to 10' doctor --seconds
expect 2 '^forceserver: --count: Value nan not in range 1 to 1000000000$' "$program" watch lab --count nan

# calibrate: steps, a step that fails and is done again, giving up, devices that cannot be calibrated.
expect 2 'calibrate needs a device' "$program" calibrate
expect 2 "'sim' has no requests" "$program" calibrate sim:
printf '\n\n\n' > enters
input=enters expect 0 '^done: it is kept$' "$program" calibrate --driver "$calibrated_driver" calibrated:0
[ "$(grep -cE '^(step 1: put it here|the hand has moved|done: it is kept)$' output)" = 3 ] || fail "calibrate does not tell its steps"
expect 1 '^as before$' "$program" calibrate --driver "$calibrated_driver" calibrated:0

# request: the answer of the driver, or why there is none.
expect 0 '^all is well$' "$program" request --driver "$troubled_driver" troubled: status
expect 2 '^forceserver: the request is: status$' "$program" request --driver "$troubled_driver" troubled: dance
expect 2 "^forceserver: a device of 'sim' has no requests$" "$program" request sim: status
expect 2 '^forceserver: request needs a device, such as: ' "$program" request
expect 2 '^forceserver: request needs a request, such as: ' "$program" request sim:
expect 0 'request .*OPTIONS\] device request$' "$program" request --help

# devices: the properties of each device; the hands and paths of the simulator in the help.
expect 0 '^sim:  simulated FIDEL$' "$program" devices
expect 0 '^    workspace   a cylinder about z: 150 mm in radius, 200 mm high, .* 20 degrees each way$' "$program" devices
expect 0 '^    force       along x, y, z, at most 25 N$' "$program" devices
expect 0 '^    torque      none$' "$program" devices
expect 0 '^    rate        1000 Hz; 0 ms ' "$program" devices
expect 0 '^    moving      0.3 kg, 1 N s/m ' "$program" devices
expect 0 'firm 0.8, 5.5, 568;' "$program" devices --help
expect 2 "^forceserver: option 'nix' is unknown; the options are hand" "$program" run --device 'sim:?nix=1' --duration 1
for key in worst $(sed -n 's/.*the options are //p' output | tr -d ','); do
  expect 0 "[?&|]$key([=.|]|$)" "$program" devices --help
done
expect 0 'figure8: 120 mm by 60 mm' "$program" devices --help

# devices --why: what is on the USB bus, here an imitated one.
if command -v umockdev-run > /dev/null && [[ $(ldd "$program") != *lib[at]san* ]]; then
  usb_device() {  # NUMBER VENDOR PRODUCT NAME
    printf '%s\n' "P: /devices/bus/usb/1-$1" "N: bus/usb/001/00$1" "E: SUBSYSTEM=usb" "E: DEVTYPE=usb_device" "A: busnum=1" \
      "A: devnum=$1" "A: idVendor=$2" "A: idProduct=$3" "A: product=$4" "A: serial=S$1" ""
  }
  { usb_device 2 0403 cb48 "FALCON HAPTIC"; usb_device 3 1451 0402 omega.3; usb_device 4 1209 0001 "Another"; } > bus.umockdev
  bus=(umockdev-run -d bus.umockdev -- "$program" devices --why)
  expect 0 '^usb 0403:cb48, Novint Falcon, serial S2 at /dev/bus/usb/001/002: ' "${bus[@]}"
  if ! ldconfig -p | grep -q 'libdrd\.so\.3'; then  # the machine of somebody without such a device
    expect 0 '^driver dhd: the Force Dimension SDK .* cannot be loaded: libdrd.so.3: cannot open shared object file' "${bus[@]}"
    expect 0 '^usb 1451:0402, device of Force Dimension, serial S3 .*: it needs the driver dhd, which cannot be used .see above.$' "${bus[@]}"
  fi
  grep -q 1209 output && fail "devices --why takes any device of 1209:0001 for a FIDEL"
  grep -q '^usb: ' output && fail "devices --why tells why there is no device although there is one"
  { usb_device 2 1209 0001 Another; usb_device 3 1d6b 0002 "A hub" | sed '$d'; printf 'A: bDeviceClass=09\n\n'; } > bus.umockdev
  expect 0 '^usb: no haptic device that forceserver knows, and 1 other device; look at the power supply ' "${bus[@]}"
  printf '%s\n' "P: /devices/none" "E: SUBSYSTEM=mem" "" > bus.umockdev
  expect 0 '^usb: this machine or container has no USB: there is no /sys/bus/usb$' "${bus[@]}"
  expect 0 '"usb_trouble": "this machine or container has no USB: ' "${bus[@]}" --json
  if grep -q '^driver falcon: /' <("$program" devices --why); then
    expect 2 'no Novint Falcon .*; this machine or container has no USB$' umockdev-run -d bus.umockdev -- "$program" request falcon:0 status
  fi
fi

# test-device: a page with verdicts; without force unless it is asked for.
expect 2 '^forceserver: test-device needs a device, such as: forceserver test-device sim:$' "$program" test-device
expect 2 "there is no driver 'nix'" "$program" test-device nix:0
expect '[01]' '^passed  nothing is left behind' "$program" test-device sim: --seconds 0.5
grep -q '^## A force' output && fail "test-device pushes without --push"
grep -q '^passed .*the machine is busy' output && fail "test-device tells that the machine is busy where nothing is late"
expect '[01]' '^passed  a force along z moves the handle along z$' "$program" test-device 'sim:?seed=3' --seconds 0.5 --push 2
expect 1 '^FAILED' "$program" test-device library:0 --driver "$losing_driver" --seconds 0.5
expect 1 '^FAILED  states are fresh: ' "$program" test-device 'sim:?link=force&link_ms=900' --seconds 0.5
expect 2 "^forceserver: a device of 'sim' has no requests$" "$program" test-device sim: --request home
# A device that says nothing, or falls silent after 0.5 s.
expect 1 '^FAILED  no silence is a fault: the longest was [4-9][0-9]{2}\.[0-9] ms' \
  "$program" test-device --driver "$troubled_driver" troubled:silent --seconds 0.5
for line in 'FAILED  ([0-9]+) of \1 readings gave no state' 'FAILED  states are fresh: none has come'; do
  grep -qE "^$line$" output || fail "test-device does not say of a silent device: $line"
done
expect 1 '^FAILED  a force along x: not pushed: no state for [0-9]+ ms$' \
  "$program" test-device --driver "$troubled_driver" troubled:stops --seconds 1 --push 1
grep -qE '^FAILED  no silence is a fault: the longest was [1-9][0-9]{2}\.' output || fail "test-device does not see that a device falls silent"
expect 1 '^FAILED  a force along x: the push was ended: no state for [2-9][0-9] ms$' \
  "$program" test-device --driver "$troubled_driver" troubled:jams --seconds 0.5 --push 1
# A push that is interrupted ends with force 0.
"$program" test-device sim: --seconds 0.5 --push 1 > pushed 2>&1 &
pushes=$!
until_says '^## A force' cat pushed
kill -TERM $pushes
wait $pushes
[ $? = 2 ] && grep -q '^interrupted; the force is 0$' pushed || fail "an interrupted push does not end with force 0"
# A thread that ends a little later than its device is not left behind.
expect '[01]' '^passed  nothing is left behind .0 open files, 0 threads.$' \
  "$program" test-device --driver "$troubled_driver" troubled:leaving --seconds 0.5
expect 1 '^FAILED  nothing is left behind .9 open files, 0 threads.$' \
  "$program" test-device --driver "$troubled_driver" troubled:leaking --seconds 0.5
expect 1 '^odd     the delay that it tells of is not far below the measured one: 0.022 ms told, 0.721 ms measured$' \
  "$program" test-device --driver "$troubled_driver" troubled:delay --seconds 0.5
grep -qE '^    status      all is well$' output || fail "test-device does not tell the answer to the request status"
grep -qE '^    resolution  exact, or not known$' output || fail "test-device takes a resolution that nobody knows for an exact one"
# A driver that hangs holds up no signal as long as there is no force.
for hangs in open control; do
  for signal in INT TERM; do
    timeout --signal=$signal --kill-after=3 1 "$program" test-device --driver "$troubled_driver" troubled:$hangs --request status > output
    [ $? = 124 ] || fail "$signal does not end a test whose driver hangs in $hangs"
  done
done

# Nor does it take a signal that must wait until there is no force: here the second and third ones, in a thread of the driver. (bash has SIGINT ignored here.)
"$program" run --driver "$troubled_driver" --device troubled:threaded > threaded 2>&1 &
runs=$!
until_says 'Ctrl-C ends$' cat threaded
for _ in 1 2 3; do
  kill -TERM $runs
  sleep 0.1
done
wait $runs
[ $? = 0 ] && grep -q '^the device is closed$' threaded || fail "a second signal ends run before the device is closed"

if command -v python3 > /dev/null; then
  "$program" devices --json > devices.json
  python3 -c "
import json
sim = [d for d in json.load(open('devices.json'))['devices'] if d['uri'] == 'sim:'][0]
info = sim['info']
assert (sim['label'], info['name'], info['serial']) == ('simulated FIDEL', 'FIDEL (simulated)', 'sim-0')
assert (info['workspace_radius'], info['workspace_height'], round(info['workspace_angle'], 3)) == (0.15, 0.2, 0.349)
assert (info['force_axes'], info['torque_axes'], info['force_max'], info['torque_max']) == (3, 0, 25, 0)
assert (info['rate'], info['delay'], info['resolution'], info['mass'], info['damping']) == (1000, 0, 2e-5, 0.3, 1)
" || { echo "FAILED: devices --json"; failures=$((failures + 1)); }
fi
expect 2 '^forceserver: ' "$program"
expect 2 "^forceserver: there is no command 'wacth'; did you mean watch\? There are: run, clients, .*, test-device, hello-device$" \
  "$program" wacth x
expect 2 "^forceserver: there is no command 'nonsense'; there are: run, " "$program" nonsense
expect 2 '^forceserver: .*duration' "$program" run --duration -1
expect 2 '^forceserver: --duration needs a number of seconds$' "$program" run --duration
expect 2 '^forceserver: --device needs the URI of a device$' "$program" run --device
expect 0 'watch .*OPTIONS\] server$' "$program" watch --help
expect 0 'resume .*OPTIONS\] server$' "$program" resume --help
expect 2 '^forceserver: resume needs a server, such as: forceserver resume lab$' "$program" resume
expect 0 'clients .*OPTIONS\] server$' "$program" clients --help
expect 0 'check .*OPTIONS\] file$' "$program" check --help
expect 0 'evaluate .*OPTIONS\] scene \[positions\]$' "$program" evaluate --help
expect 0 'run .*OPTIONS\] \[scene\]$' "$program" run --help

# For every command the message names the unknown option, not its value, and the option that may have been meant.
expect 2 '^forceserver: run has no option --nonsense; see: forceserver run --help$' "$program" run --nonsense
expect 2 '^forceserver: run has no option --duraton; did you mean --duration\?$' "$program" run --duraton 1
expect 2 '^forceserver: run has no option --duraton; did you mean --duration\?$' "$program" run "$scene" --duraton=1
expect 2 '^forceserver: run has no option --listn; did you mean --listen\?$' "$program" run --listn lab --duration 1
expect 2 '^forceserver: run has no option -d; see: forceserver run --help$' "$program" run -d 1
expect 2 '^forceserver: clients has no option --jsn; did you mean --json\?$' "$program" clients --jsn
expect 2 '^forceserver: watch has no option --inteval; did you mean --interval\?$' "$program" watch lab --inteval 5
expect 2 '^forceserver: check has no option --scales; did you mean --scale\?$' "$program" check --scales 1
expect 2 '^forceserver: evaluate has no option --tim; did you mean --time\?$' "$program" evaluate --tim 1
expect 2 '^forceserver: devices has no option --lits; see: forceserver devices --help$' "$program" devices --lits
expect 2 '^forceserver: there is no option --versoin; did you mean --version\?$' "$program" --versoin
expect 2 "^forceserver: run takes no 'b.json' after 'a.json'$" "$program" run a.json b.json
expect 2 "^forceserver: watch takes no 'other' after 'lab'$" "$program" watch lab other
expect 2 "^forceserver: devices takes no 'sim:'$" "$program" devices sim:
expect 2 '^forceserver: watch needs a server, such as: forceserver watch lab$' "$program" watch
expect 2 '^forceserver: check needs a file, such as: forceserver check room.json$' "$program" check
expect 2 '^forceserver: evaluate needs a scene, such as: forceserver evaluate room.json points.csv$' "$program" evaluate

# --driver: a driver of one's own.
expect 2 "there is no driver 'library'" "$program" run --device library:0 --duration 0.1
expect 1 '^a device from a library .library:0., at most 5 N$' "$program" run --driver "$losing_driver" --device library:0 --duration 0.5
expect 0 '^nothing odd$' "$program" check "$scene" --driver "$losing_driver"
expect 0 '^sim:' "$program" devices --driver "$losing_driver"
expect 2 '^forceserver: .*nowhere.so' "$program" run --driver ./nowhere.so
cp "$losing_driver" here.so
expect 2 '^forceserver: .*; for the file in this folder write ./here.so$' "$program" run --driver here.so
expect 2 "^forceserver: device 'fidel' has no scheme, such as sim: or falcon:0$" "$program" test-device fidel
expect 2 "no Novint Falcon|there is no driver 'falcon', and no module" "$program" run --device falcon:0

# run: a summary, a record without a gap, errors with a sentence.
expect 0 '^protections switched off: none$' \
  "$program" run "$scene" --duration 1 --record ticks.csv
for line in '; no force was changed by a limit, a fault or a stop$' \
  '^slopes up to 5407 N/m, local damping 5.0 N s/m, energy given to the hand '; do
  grep -q "$line" output || { echo "FAILED: run does not say $line"; failures=$((failures + 1)); }
done
grep -q chatters output && { echo "FAILED: run says of a quiet hand that it chatters"; failures=$((failures + 1)); }
# A force that swings 12 times a second shakes the hand, whatever the loop does.
cat > drum.json << 'END'
{"forceserver": "scene", "version": 1, "curves": {"beat": {"expression": "1+sin(75*t)"}},
 "objects": [{"name": "far", "primitive": "point", "pose": {"position": [0, 0, 0.5]},
              "front": {"kind": "constant", "gain": 0.2, "limit": 1}},
             {"name": "drum", "primitive": "plane", "pose": {"position": [0, 0, -1]},
              "front": {"kind": "custom", "sense": "repulsive", "gain": 3, "limit": 6, "curve": "beat"}}]}
END
expect 1 ' the hand chatters: [0-9]* times a second, [0-9.]* mm from end to end, .*; changes most: drum, ' \
  "$program" run drum.json --device 'sim:?hand=worst' --duration 2
grep -qE '(^|,)-0(,|$)' ticks.csv && { echo "FAILED: a record has -0"; failures=$((failures + 1)); }
expect 2 '^forceserver: .*no-such\.json' "$program" run no-such.json --duration 1
[ "$(head -1 ticks.csv)" = time,x,y,z,qw,qx,qy,qz,fx,fy,fz,sent_fx,sent_fy,sent_fz,late,compute,faults,tx,ty,tz,sent_tx,sent_ty,sent_tz,buttons ] ||
  { echo "FAILED: the record has other columns"; failures=$((failures + 1)); }
[ "$(awk -F, '{ print NF }' ticks.csv | sort -u)" = 24 ] || { echo "FAILED: a line of the record is not whole"; failures=$((failures + 1)); }
grep -qE '^time,x,y,z,' ticks.csv || { echo "FAILED: no record"; failures=$((failures + 1)); }
awk -F, 'NR > 2 && $1 <= last { print "FAILED: the tick at " $1 " is recorded after that at " last; bad = 1 } { last = $1 }
  END { if (NR < 20) print "FAILED: the record has only " NR - 1 " ticks"; exit bad || NR < 20 }' ticks.csv || failures=$((failures + 1))
expect 2 '^forceserver: .*no-such' "$program" run --device no-such: --duration 1
expect 2 '^forceserver: cannot write no/folder/ticks.csv: ' "$program" run --duration 1 --record no/folder/ticks.csv
expect 2 'cannot write big.csv: .*goes on' bash -c 'ulimit -f 10; "$0" run --duration 1 --record big.csv' "$program"
if [ -w /dev/full ]; then
  expect 2 'cannot write /dev/full.*goes on' "$program" run --duration 1 --record /dev/full
fi
nohup "$program" run > ended 2>&1 &
runs=$!
until_says '^the device is ready$' cat ended
kill -HUP $runs  # nohup: the terminal may go
sleep 0.5
kill -0 $runs || { echo "FAILED: a hang-up ends a run under nohup"; failures=$((failures + 1)); }
kill -INT $runs
wait $runs
status=$?
if [ $status != 0 ] || ! grep -q '^faults: none' ended; then
  echo "FAILED: an interrupted run ended with $status:"
  sed 's/^/    /' ended
  failures=$((failures + 1))
fi
# Before the servo starts, a signal ends the program at once: here it waits for a reader of its record.
mkfifo pipe
for signal in INT TERM; do
  timeout --signal=$signal --kill-after=9 1 "$program" run --record pipe
  [ $? = 124 ] || { echo "FAILED: $signal does not end a run that begins"; failures=$((failures + 1)); }
done
expect 2 '^forceserver: .*zero: is a device, must be a file$' "$program" run --device 'sim:?path=/dev/zero' --duration 1

# evaluate: the floor of the scene is at z = -0.05 with 800 N/m.
printf 'x y z\n# a comment\n0 0 -0.06   # 10 mm deep\n\n0,0,-0.055\r\n' > points
expect 0 '^0,0,-0\.055,0,0,(4\.0000|3\.99999)' "$program" evaluate "$scene" points --object floor
expect 0 '^0,0,-0\.055,0,0,(4\.0000|3\.99999)' "$program" evaluate "$scene" --object floor points
input=points expect 0 '^0,0,-0\.055,0,0,(4\.0000|3\.99999)' "$program" evaluate "$scene" --object floor
input=points expect 0 '^0,0,-0\.059999999999999998,0,0,(8|7\.99999)' "$program" evaluate "$scene" --object floor
seq 1 20000 | awk '{ print $1 * 1e-6, 0.05, 0.05 }' > many
"$program" evaluate "$scene" --time 0.4 many > first
"$program" evaluate "$scene" --time 0.4 < many > second
cmp first second || failures=$((failures + 1))
[ "$(wc -l < first)" = 20001 ] || { echo "FAILED: lines are missing"; failures=$((failures + 1)); }
"$program" evaluate "$scene" --time 0.5 many | cmp -s - first && {
  echo "FAILED: the pulse does not depend on time"
  failures=$((failures + 1))
}
printf '0 0 0\n0 0 0 0\n' > four
expect 2 'four, line 2: .*three' "$program" evaluate "$scene" four
printf '0 0 0\n0 0 nan\n' > number
expect 2 'line 2: ' "$program" evaluate "$scene" number
printf '+0 -0 +0.1\n' > number
expect 0 '^0,0,0\.1' "$program" evaluate "$scene" number  # no -0
printf '0 0 x\n1 2\n' > number
input=number expect 2 '^forceserver: standard input, line 1: ' "$program" evaluate "$scene"
for signs in +- -+ ++ --; do
  printf '0 0 0\n0 0 %s5\n' $signs > number
  expect 2 'line 2: ' "$program" evaluate "$scene" number
done
expect 2 'no-object' "$program" evaluate "$scene" --object no-object points
grep -q '^x,y,z' output && { echo "FAILED: evaluate prints a header before an error"; failures=$((failures + 1)); }
expect 0 '^x,y,z,fx,fy,fz$' "$program" evaluate "$scene" /dev/null
expect 2 'no-points' "$program" evaluate "$scene" no-points
[ ! -w /dev/full ] || "$program" evaluate "$scene" many 2> output > /dev/full
grep -q 'cannot write the forces' output || { echo "FAILED: a full disk is not noticed"; failures=$((failures + 1)); }

printf 'v -0.1 -0.1 0\nv 0.1 -0.1 0\nv 0 0.1 0\nf 1 2 3\n' > sheet.obj
for keep in either front; do
  cat > sheet.json << END
{"forceserver": "scene", "version": 1, "shapes": {"s": {"file": "sheet.obj"}}, "objects": [{"name": "sheet",
  "primitive": "mesh", "shape": "s", "contact": {"keep": "$keep", "stiffness": 500, "limit": 5}}]}
END
  expect 0 "^forceserver: the contact of 'sheet' is left out: it keeps a hand on the side from which it comes$" \
    "$program" evaluate sheet.json points
  [ $keep = front ] || expect 0 '^nothing odd$' "$program" check sheet.json
done
expect 1 'open edges' "$program" check sheet.json

# check: scenes that are fine, scenes that are odd, files that cannot be read.
expect 0 '^nothing odd$' "$program" check "$scene"
cat > odd.json << 'END'
{"forceserver": "scene", "version": 1, "objects": [
  {"name": "mute", "primitive": "plane"},
  {"name": "off", "primitive": "point", "enabled": false,
   "front": {"kind": "constant", "sense": "attractive", "gain": 1, "limit": 1}},
  {"name": "far", "primitive": "point", "pose": {"position": [9, 0, 0]},
   "front": {"kind": "gaussian", "sense": "repulsive", "gain": 1, "width": 0.01, "limit": 1}},
  {"name": "strong", "primitive": "point", "tool_points": 3,
   "front": {"kind": "gaussian", "sense": "repulsive", "gain": 1, "width": 0.01, "limit": 1000}}]}
END
expect 1 '^7 odd things$' "$program" check odd.json
expect 1 'strong: its tool_points select points that the tool does not have: it has 1$' "$program" check odd.json
expect 1 'mute: it has no profile' "$program" check odd.json
{ echo '{"forceserver": "scene", "version": 1, "objects": [{"name": "mute 0", "primitive": "plane"}'
  for i in $(seq 19); do echo ", {\"name\": \"mute $i\", \"primitive\": \"plane\"}"; done
  echo ']}'; } > many.json
expect 1 '^odd as mute 0, mute 1 and mute 2: mute 3, .*, mute 10 and 9 more$' "$program" check many.json
[ "$(grep -c 'it has no profile' output)" = 3 ] || fail "check says the same more than three times"
expect 1 '^20 odd things$' "$program" check many.json
expect 1 'off: it is disabled' "$program" check odd.json
expect 1 'far: the hand cannot get near' "$program" check odd.json
expect 1 'strong: its limit of 1000 N' "$program" check odd.json
expect 1 'off: its force reverses across its point: a jump of 2 N$' "$program" check odd.json
expect 1 'strong: its force reverses across its point: a jump of 2 N$' "$program" check odd.json
cat > honey.json << 'END'
{"forceserver": "scene", "version": 1, "objects": [{"name": "honey", "primitive": "point", "damping": 20,
  "front": {"kind": "constant", "sense": "attractive", "gain": 1e-6, "limit": 5, "reach": 0.03}}]}
END
expect 0 '^nothing odd$' "$program" check honey.json
printf 'v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n' > solid.obj
# Each kind of jump is reported with its place; a force without a jump is fine. A jump out of reach does not count.
scene_of() {  # OBJECT: what is in its braces
  echo '{"forceserver": "scene", "version": 1,
    "shapes": {"bent": {"points": [[-0.05, 0, 0], [0, 0.03, 0], [0.05, 0, 0]]},
               "straight": {"points": [[-0.05, 0, 0], [0, 0.03, 0], [0.05, 0.06, 0]]},
               "part": {"file": "solid.obj"}},
    "curves": {"pulse": {"expression": "2*(1+sin(12*t))*exp(-d/0.01)"}, "ends": {"expression": "50*d*(1-d/0.02)"}},
    "objects": [{"name": "x", '"$1"'}]}' > one.json
}
odd() {  # PATTERN OBJECT
  scene_of "$2"
  expect 1 "^  odd: x: $1" "$program" check one.json
}
fine() {  # OBJECT
  scene_of "$1"
  expect 0 '^nothing odd$' "$program" check one.json
}
spring='"kind": "linear_increasing", "gain": 150, "limit": 2'
odd 'its force reverses across its point: a jump of 7\.[0-9]+ N$' \
  '"primitive": "point", "front": {"kind": "custom", "gain": 1, "limit": 5, "sense": "repulsive", "curve": "pulse"}'
odd 'its force reverses across its line: a jump of 3 N$' \
  '"primitive": "polyline", "shape": "straight", "front": {"kind": "gaussian", "gain": 1.5, "width": 0.01, "limit": 2}'
odd 'its force changes its direction where two of its parts are equally near: a jump of up to 2\.06 N$' \
  '"primitive": "polyline", "shape": "bent", "front": {'"$spring"'}'
odd 'its force ends at its reach of 10 mm: a jump of 1.5 N$' \
  '"primitive": "point", "front": {"reach": 0.01, '"$spring"'}'
odd 'its force behind ends at its reach of 10 mm: a jump of 1.5 N$' \
  '"primitive": "plane", "back": {"reach": 0.01, '"$spring"'}'
odd 'its force jumps at its surface, where front and back do not agree: a jump of 1 N$' \
  '"primitive": "plane", "front": {"kind": "constant", "gain": 1, "limit": 2, "sense": "repulsive"}'
scene_of '"primitive": "mesh", "shape": "part", "back": {'"$spring"'}'
expect 0 '^  note: x: where another of its faces becomes the nearest, .* a jump of up to 4 N' "$program" check one.json
scene_of '"primitive": "mesh", "shape": "part", "back": {"kind": "linear_increasing", "gain": 150, "limit": 60}'
expect 1 '^  note: x: where another of its faces .* a jump of up to 15 N' "$program" check one.json  # it is 100 mm thick
fine '"primitive": "mesh", "shape": "part", "back": {'"$spring"'}'
odd 'it pulls the hand with 20 N or more from everywhere beyond' \
  '"primitive": "mesh", "shape": "part", "front": {"kind": "constant", "gain": 20, "limit": 20}'
fine '"primitive": "point", "front": {'"$spring"'}'
fine '"primitive": "polyline", "shape": "straight", "front": {'"$spring"'}'
fine '"primitive": "point", "front": {"kind": "custom", "gain": 1, "limit": 5, "reach": 0.02, "curve": "ends"}'
fine '"primitive": "plane", "front": {"kind": "constant", "gain": 1, "limit": 1, "sense": "repulsive"},
      "back": {"kind": "constant", "gain": 1, "limit": 1}'
fine '"primitive": "plane", "pose": {"position": [0, 0, -9]},
      "front": {"kind": "constant", "gain": 1, "limit": 1, "sense": "repulsive"}'
# Of the four planes with one profile, one is a wall. Two attractive sides hold the hand in the plane.
fine '"primitive": "plane", "back": {'"$spring"'}'
fine '"primitive": "plane", "front": {'"$spring"'}, "back": {'"$spring"'}'
fine '"primitive": "plane", "front": {"kind": "constant", "gain": 2, "limit": 2},
      "back": {"kind": "constant", "gain": 2, "limit": 2, "sense": "repulsive"}'  # gravity
odd 'its force is 0 wherever the hand gets$' \
  '"primitive": "point", "front": {"kind": "custom", "gain": 0, "limit": 5, "curve": "pulse"}'
# A back that the hand never comes to is not felt. A point that pulls with half of the device's force is odd.
odd 'the hand cannot get to the side on which it is felt: it is at least 2\.9 m of the scene away from the device' \
  '"primitive": "plane", "pose": {"position": [0, 0, -3]}, "back": {'"$spring"'}'
odd 'the hand is behind it wherever it is, by 2\.9 m at least: it is pushed with up to [0-9.]+ N all the time' \
  '"primitive": "plane", "pose": {"position": [0, 0, 3]}, "back": {'"$spring"'}'
odd 'the hand is behind it wherever it is, by 10 mm at least: it is pushed with up to 2 N' \
  '"primitive": "plane", "pose": {"position": [0, 0, 0.11]}, "back": {'"$spring"'}'
fine '"primitive": "plane", "pose": {"position": [0, 0, 0.11], "orientation": [0.7071, 0.7071, 0, 0]}, "back": {'"$spring"'}'
odd 'it pulls the hand with 12\.[0-9]+ N or more from everywhere beyond 12\.[0-9]+ mm: give it a smaller limit' \
  '"primitive": "point", "front": {"kind": "linear_increasing", "gain": 1000, "limit": 25}'
# The steepest slope, and what the servo renders while nobody holds the device: (1 + 5) N s/m divided by 1 ms, or half of what
# shakes the device.
wall='"primitive": "plane", "back": {"kind": "linear_increasing", "limit": 10, "gain"'
odd 'its slope of 1e\+06 N/m at the device would shake it when nobody holds it: a servo at 1000 Hz with a local damping of 5 N ' \
  "$wall: 1e6}"
odd 'its slope of 5500 N/m' "$wall: 5500}"
fine "$wall: 5300}"
expect 0 '^x: a plane; .*; steepest slope 5300 N/m at the device$' "$program" check one.json
expect 1 'its slope of 5300 N/m .* renders 1133 N/m, shared by all that overlap, and reduces it to 1133 N/m' \
  "$program" check one.json --device 'sim:?delay_ms=2'
# Two at one place share it.
wall_of() { echo '{"name": "'"$1"'", '"$wall"': 4000}}'; }
echo '{"forceserver": "scene", "version": 1, "objects": ['"$(wall_of a)"', '"$(wall_of b)"']}' > two.json
expect 0 '^  note: a: its steepest slope is 4000 N/m at the device; a servo reduces it to 27[0-9][0-9] N/m, because' \
  "$program" check two.json
odd 'its force goes on through its surface, so it turns at once at an edge: a jump of up to 4 N' \
  '"primitive": "mesh", "shape": "part", "front": {"kind": "constant", "gain": 2, "limit": 2},
   "back": {"kind": "constant", "gain": 2, "limit": 2, "sense": "repulsive"}'
odd 'it pulls the hand towards it from everywhere' '"primitive": "mesh", "shape": "part", "front": {'"$spring"'}'
fine '"primitive": "plane", "front": {"kind": "constant", "gain": 1, "limit": 1},
      "back": {"kind": "constant", "gain": 1, "limit": 1, "sense": "repulsive"}'  # gravity
odd 'it pulls the hand towards it from everywhere in front' '"primitive": "plane", "front": {'"$spring"'}'
odd 'it pushes the hand away in front, harder' '"primitive": "plane", "front": {"sense": "repulsive", '"$spring"'}'
odd 'its back drives the hand deeper' '"primitive": "plane", "back": {"sense": "repulsive", '"$spring"'}'
expect 0 'closed mesh of 4 triangles and 4 points' "$program" check solid.obj
{ cat solid.obj
  awk '/^v/ { print "v", $2 + 0.01, $3 + 0.01, $4 + 0.01 } /^f/ { print "f", $2 + 4, $3 + 4, $4 + 4 }' solid.obj; } > two.obj
expect 0 'of parts that meet: for profiles they are one body' "$program" check two.obj
awk '/^f/ { print "f", $2, $4, $3; next } { print }' solid.obj > inside_out.obj
scene_of '"primitive": "mesh", "shape": "part", "front": {'"$spring"'}'
sed 's/solid.obj/inside_out.obj/' one.json > room.json
expect 0 '^nothing odd$' "$program" check room.json
expect 0 '^  note: its triangles face inwards: its front is inside, as that of a room$' "$program" check inside_out.obj
awk '/^f/ && ++n > 4 { print "f", $2, $4, $3; next } { print }' two.obj > one_inside_out.obj
expect 0 '^  note: the triangles of 1 of its 2 parts face inwards: such a part is a hollow' "$program" check one_inside_out.obj
"$program" check solid.obj | grep inwards && fail "check finds a mesh inside out that is not"
sed '$d' solid.obj > open.obj
expect 1 'inside and outside are not decided everywhere' "$program" check open.obj
expect 1 '3 open edges' "$program" check open.obj
printf 'v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n' > one.obj
expect 1 'open mesh of 1 triangle and 3 points' "$program" check one.obj
expect 1 'millimetres' "$program" check solid.obj --scale 1000
expect 2 '^forceserver: ' "$program" check no-such.stl
touch t.csv
expect 2 '^forceserver: t.csv is not checked: a scene ends in .json, a mesh in .obj, .ply, .stl or .off$' "$program" check t.csv
# How much a line turns: 2 * 2.5 N * sin(13 degrees / 2); a circle of one degree a point, felt within 20 mm.
polyline() {  # PYTHON: the points
  python3 -c "
from math import *
print(__import__('json').dumps([[round(c, 12) for c in p] for p in $1]))"
}
turning() {  # POINTS CLOSED FRONT
  echo '{"forceserver": "scene", "version": 1, "shapes": {"s": {"points": '"$(polyline "$1")"', "closed": '"$2"'}},
    "curves": {"near": {"step": 0.01, "table": [0, 2.5, 0]}},
    "objects": [{"name": "x", "primitive": "polyline", "shape": "s", "front": '"$3"'}]}' > one.json
}
if command -v python3 > /dev/null; then
  guide='[[-.1,0,0],[0,0,0],[.1*cos(radians(13)),.1*sin(radians(13)),0]]'
  circle='[[.05*cos(radians(i)),.05*sin(radians(i)),0] for i in range(360)]'
  hold='{"kind": "linear_increasing", "gain": 200, "limit": 2.5}'
  turning "$guide" false "$hold"
  expect 1 '^  odd: x: its force changes its direction .* a jump of up to 0.566 N$' "$program" check one.json
  turning "$circle" true "$hold"
  expect 1 '^  odd: x: its force changes its direction .* a jump of up to 5 N$' "$program" check one.json  # at the centre
  turning "$circle" true '{"kind": "custom", "gain": 1, "limit": 2.5, "curve": "near"}'
  expect 0 '^  note: x: its force changes its direction .* a jump of up to 0.0436 N$' "$program" check one.json
fi
# Millimetres that were meant as metres. Gravity may lie anywhere.
far='"pose": {"position": [50, 0, 0]}'
odd 'it is felt although it is at least 49.82 m of the scene away .*; are its numbers millimetres\? Lengths are in metres$' \
  '"primitive": "point", '"$far"', "front": {"kind": "constant", "gain": 10, "limit": 10}'
odd 'the hand cannot get near enough to feel it: .* 49.82 m of the scene away .*; are its numbers millimetres\?' \
  '"primitive": "point", '"$far"', "front": {"kind": "gaussian", "gain": 1, "width": 0.01, "limit": 1}'
odd 'it is felt although .*; are its numbers millimetres\?' \
  '"primitive": "plane", "pose": {"position": [0, 0, 50]}, "back": {'"$spring"'}'
fine '"primitive": "plane", "pose": {"position": [0, 0, -50]}, "front": {"kind": "constant", "gain": 2, "limit": 2},
      "back": {"kind": "constant", "gain": 2, "limit": 2, "sense": "repulsive"}'
printf 'v -50 -50 0\nv 50 -50 0\nv 0 50 0\nf 1 2 3\n' > large.obj
echo '{"forceserver": "scene", "version": 1, "shapes": {"s": {"file": "large.obj"}}, "objects": [{"name": "x",
  "primitive": "mesh", "shape": "s", "back": {'"$spring"'}}]}' > one.json
expect 1 '^  odd: x: it is 141.4 m across, and the device.s workspace 360.6 mm; are its numbers millimetres\?' "$program" check one.json
# Forces in time.
timed() {  # EXPRESSION
  echo '{"forceserver": "scene", "version": 1, "curves": {"c": {"expression": "'"$1"'"}}, "objects": [{"name": "x",
    "primitive": "point", "front": {"kind": "custom", "gain": 1, "limit": 5, "curve": "c"}}]}' > one.json
}
timed 't > 1.5 ? 200*d : 100*d'
expect 1 '^  odd: x: its force jumps in time: by about 2\.[0-9]* N at 1.5 s after its start$' "$program" check one.json
timed '100*d*(1+sin(75*t))'
expect 0 '^  note: x: its force changes with time, by up to [345](\.[0-9]*)? N in 10 ms$' "$program" check one.json
timed '100*tanh(d)'
expect 0 '^nothing odd$' "$program" check one.json
grep -q 'with time' output && { echo "FAILED: tanh is not the time"; failures=$((failures + 1)); }
echo '{"forceserver": 1' > broken.json
expect 2 '^forceserver: .*broken\.json' "$program" check broken.json

# run --listen, clients and watch: a server, the programs that show its state, and how all of them end.
name=program-test-$$
as=()  # the command by which the server becomes another user's
listen() {  # OPTION...: a server in the background: $server
  : > served  # what the one before said
  "${as[@]}" "$program" run --listen "$name" "$@" > served 2>&1 < /dev/null &
  server=$!
  until_says '^listens at shm:' cat served
}
ended() {  # PROCESS STATUS WHAT
  local status
  wait "$1"
  status=$?
  [ $status = "$2" ] || fail "$3 ended with $status, expected $2"
}
json() {  # FILE PYTHON: a statement about d, what each line of the file holds
  python3 -c "
import json, sys
for d in map(json.loads, open('$1')):
    $2" || { fail "$1 is not as expected: $2"; cat "$1"; }
}
user=$(id -un)
expect 2 "no server of user $user listens at shm:$name; .* --listen $name; .*'$name\?user=NAME'$" \
  "$program" clients "$name"
expect 2 "no server of user $user listens at shm:$name; " "$program" watch "shm:$name?timeout=0.1"
expect 2 'no server of user 12345 listens at shm:[^ ]+$' "$program" watch "$name?timeout=0&user=12345"
expect 2 '^forceserver: --client-force: force_limit is 30, ' "$program" run --listen "shm:$name" --client-force 30
expect 2 '^forceserver: .*listen' "$program" run --locked --duration 1
expect 2 '^forceserver: .*listen' "$program" run --max-objects 9 --duration 1
expect 2 '^forceserver: .*max-clients' "$program" run --listen "$name" --max-clients 4097
expect 2 '^forceserver: .*count' "$program" watch "$name" --count 0

listen "$scene" --device 'sim:?hold=0,0,-0.09' --locked --all-users --client-force 5
expect 2 "$name" "$program" run --listen "shm:$name" --duration 1
expect 0 "^server +$server +[^ ]+ +[1-9]" "$program" clients "$name"
"$program" watch "$name" --interval 0.1 > watched 2>&1 &
watcher=$!
until_says "^watch-$watcher " "$program" clients "$name"
until_says '^hand  ' cat watched
expect 0 "^watch-$watcher +$watcher +[^ ]+ +0 " "$program" clients "shm:$name?user=$(id -u)"
if [ "$(id -u)" = 0 ] && setpriv --reuid=65534 test -x "$program" 2> /dev/null; then
  expect 0 '^server ' setpriv --reuid=65534 "$program" clients "shm:$name?user=0"
fi
expect 0 '^servo +faults: none; [0-9]+ Hz' "$program" watch "$name" --count 1
expect 0 '^server/floor +plane +felt +1\.00 ' "$program" watch "$name" --count 2 --interval 0.05
"$program" watch "$name" --count 1 --interval 0.05 | grep 'is ready' && fail "the device is ready: that is no news"
if [ -w /dev/full ]; then
  for command in clients 'clients --json' 'watch --count 1' 'watch --count 1 --json'; do
    expect 2 '^forceserver: cannot write: ' sh -c "\"\$0\" $command \"\$1\" > /dev/full" "$program" "$name"
  done
fi
"$program" clients "$name" --json > clients.json
if command -v python3 > /dev/null; then
  python3 -m json.tool clients.json > /dev/null || fail "clients --json is not JSON"
  "$program" watch "$name" --json --interval 0.1 --count 3 > looks.json
  [ "$(wc -l < looks.json)" = 3 ] || fail "watch --count 3 has not written 3 lines"
  json looks.json "assert d['servo']['new_ticks'] > 0 and d['servo']['faults'] == []"
  json looks.json "assert 'watch-$watcher' in [c['name'] for c in d['clients']]"
  json looks.json "assert [c['force_limit'] for c in d['clients']] == [25, 5]"
  json looks.json "floor = [o for o in d['objects'] if (o['client'], o['name']) == ('server', 'floor')][0]
    assert floor['force'][2] > 1 and floor['weight'] == 1"
  json looks.json "assert [o['stiffness_wanted'] for o in d['objects'][:2]] == [800, 150]
    assert 100 < d['objects'][2]['stiffness_wanted'] < 600"
fi
kill -INT $watcher
ended $watcher 0 "watch, interrupted,"
until_says "^client watch-$watcher .process $watcher. left$" cat served
"$program" watch "$name" --interval 0.1 > killed 2>&1 &
watcher=$!
until_says "^client watch-$watcher .process $watcher. connected$" cat served
kill -KILL $watcher
wait $watcher 2> /dev/null
until_says "^client watch-$watcher .process $watcher. was lost: it was killed, or ended without a word$" cat served
grep -q '^hand  ' watched || fail "watch wrote nothing"
"$program" watch "$name" --interval 0.1 2> output | sed 2q > watched
[ "${PIPESTATUS[0]}" = 0 ] || fail "watch whose reader has gone did not end with 0"
if command -v script > /dev/null; then
  script -qec "$program watch $name --count 2 --interval 0.1" /dev/null < /dev/null > watched
  grep -q $'\e\\[H' watched || fail "watch on a terminal does not go back to its top"
  sed -n $'/\e\\[?1049l/,$p' watched | grep -q '^server/' || fail "the last look does not stay on the terminal"
fi
"$program" watch "$name" --interval 0.1 > watched 2>&1 &
watcher=$!
until_says '^hand  ' cat watched
kill -INT $server
ended $server 0 "run with a client"
ended $watcher 1 "watch whose server has gone"
grep -q "the server at shm:$name has gone" watched || fail "watch does not say that the server has gone"
grep -q '^faults: none' served || fail "run with a client ended without a summary"

# A server without a terminal: a client ends the force, and a command lets it return.
listen --device 'sim:?hold=0.03,0,0'
expect 0 "^the force at shm:$name was not stopped$" "$program" resume "$name"
"$program" watch "$name" --interval 0.1 > watched &
watcher=$!
until_says '^hand  ' cat watched
expect 0 "^the force at shm:$name has ended; .forceserver resume $name. lets it return$" "$program" stop "$name"
until_says "^client: stop-[0-9]* stopped all force$" cat watched
until_says "^client stop-[0-9]* .process [0-9]*. stopped all force$" cat served
grep -q "let the force return$" served && fail "run says that a force returned which was there"
expect 0 "^the force at shm:$name returns$" "$program" resume "$name"
until_says "^client: resume-[0-9]* let the force return$" cat watched
kill -INT $watcher
ended $watcher 0 "watch of a server whose force was ended"
"$stop_force" "$name" || fail "the force cannot be ended"
expect 0 "^servo  no force: it was stopped; .forceserver resume $name. lets it return; faults: none; " "$program" watch "$name" --count 1
until_says "^client .* .process [0-9]*. stopped all force$" cat served
until_says "; a client stopped the force: .forceserver resume $name. lets it return$" cat served
expect 0 "^the force at shm:$name returns$" "$program" resume "$name"
until_says "^client resume-[0-9]* .process [0-9]*. let the force return$" cat served
expect 0 '^servo  faults: none; ' "$program" watch "$name" --count 1
if [ "$(id -u)" = 0 ] && setpriv --reuid=65534 test -x "$program" 2> /dev/null; then
  expect 2 "^forceserver: no server of user " setpriv --reuid=65534 "$program" resume "$name"
fi
kill -INT $server
ended $server 0 "run whose force was ended"

# The maxima of a server.
listen --max-clients 1 --max-objects 2
expect 0 '' "$program" clients "$name"
"$program" watch "$name" --interval 0.1 > watched &
watcher=$!
until_says '^hand  ' cat watched
expect 2 '^forceserver: the server has 1 client, its maximum \(max_clients\)$' "$program" clients "$name"
kill -INT $watcher
ended $watcher 0 "watch of a server that is full"
echo '{"forceserver": "scene", "version": 1, "objects": ['"$(wall_of a), $(wall_of b), $(wall_of c)"']}' > three.json
expect 1 'the server allows a client 2 \(max_objects\)$' "$stop_force" "$name" three.json
kill -INT $server
ended $server 0 "run with other maxima"

# Another user's server: what is said is what that user or root may do.
if [ "$(id -u)" = 0 ] && setpriv --reuid=65534 test -x "$program" 2> /dev/null; then
  listen --all-users
  expect 0 "^the force at shm:$name\?user=0 has ended; only the user 0, whose server it is, may let it return: forceserver resume $name$" \
    setpriv --reuid=65534 "$program" stop "$name?user=0"
  expect 0 "it was stopped; only the user root, whose server it is, may .*: forceserver resume $name; faults" \
    setpriv --reuid=65534 "$program" watch "$name?user=root" --count 1
  expect 0 "it was stopped; .forceserver resume '$name\?timeout=5'. lets it return; faults" "$program" watch "$name?timeout=5" --count 1
  kill -INT $server
  ended $server 0 "run whose force another user ended"
  as=(setpriv --reuid=65534 --regid=65534 --clear-groups)
  listen --all-users
  as=()
  expect 0 "has ended; only the user 65534, whose server it is, and root may let it return: forceserver resume $name$" \
    setpriv --reuid=65533 "$program" stop "$name?user=65534"
  expect 0 "has ended; .forceserver resume '$name\?user=65534'. lets it return$" "$program" stop "$name?user=65534"
  expect 0 "^the force at shm:$name\?user=65534 returns$" "$program" resume "$name?user=65534"
  kill -INT $server
  ended $server 0 "run of another user"
fi

# A hand that is too fast after a second, and an object whose lifetime is over by then.
printf '0 0 0 0\n1 0 0 0\n1.01 0.5 0 0\n' > jump
echo '{"forceserver": "scene", "version": 1, "objects": [{"name": "brief", "primitive": "point", "lifetime": 0.3,
  "front": {"kind": "constant", "sense": "attractive", "gain": 1, "limit": 1}}]}' > brief.json
listen brief.json --device 'sim:?path=jump&hand=firm'
until_says '^the force stopped' "$program" watch "$name" --count 1
expect 0 '^the force stopped \(.*\): the hand was above speed_limit, [0-9.]+ m/s$' "$program" watch "$name" --count 1
expect 0 '^server/brief +point +expired +0\.00 ' "$program" watch "$name" --count 1
expect 0 "^the force at shm:$name returns$" "$program" resume "$name"
until_says '^servo  faults: none; ' "$program" watch "$name" --count 1
kill -INT $server
ended $server 1 "run after a fault"
grep -q "^the force stopped: the hand was above speed_limit, [0-9.]* m/s; .forceserver resume $name. lets it return$" served || fail "run does not say what to do"

# Who shares what can be rendered, and with whom.
echo '{"forceserver": "scene", "version": 1, "objects": ['"$(wall_of a)"', '"$(wall_of b)"']}' > two.json
listen two.json
until_says '^server/a .* [0-9.]+ of 4000 +b$' "$program" watch "$name" --count 1
until_says '^server/b .* [0-9.]+ of 4000 +a$' "$program" watch "$name" --count 1
"$program" watch "$name" --count 1 --json > looks.json
json looks.json "assert [o['shares_with'] for o in d['objects'][:2]] == ['b', 'a']"
kill -INT $server
ended $server 0 "run of two walls"

grep "$name" /proc/net/unix && fail "a socket is left"

# A device that is lost between two looks of the program, and back at once, is not overlooked.
expect 1 '^faults: the device is not ready$' env LD_PRELOAD="$losing_driver" ASAN_OPTIONS=verify_asan_link_order=0 \
  "$program" run --device library:0 --duration 0.5
grep -q '^the device does not tell its mass: 0.05 kg is assumed' output || fail "run does not say that it assumes a mass"
grep -q "^the force stopped: lost: it is not connected; " output || fail "run does not say that the device was lost"

echo "$failures failures"
[ $failures = 0 ]

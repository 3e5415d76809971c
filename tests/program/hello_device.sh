#!/usr/bin/env bash
# hello_device.sh PROGRAM HELLO_DRIVER: the first touch of a device, by a person who tells the truth of it. All devices at once.
set -uo pipefail
program=$1 driver=$2
folder=$(mktemp -d)
trap 'kill $(jobs -p) 2> /dev/null; rm -rf "$folder"' EXIT
cd "$folder" || exit 1
failures=0
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}

# await_push SECONDS: until the motors push, and no longer than that; the person then knows which way. await_rest: until they do not.
await_push() { await '[^n]' "$1"; }
await_rest() { await n "$1"; }
await() {
  for _ in $(seq $((10 * $2))); do
    way=$(< felt)
    [[ $way == $1 ]] && return
    sleep 0.1
  done
}
hold() {  # PLACE: the hand brings the handle there
  printf %s "$1" > hand
  sleep 0.3
}

# person CHARACTER: does what the questions on the standard input ask for, and prints the answers.
person() {
  local line way
  trap '' PIPE
  while IFS= read -r line; do
    echo "$line" >> output
    case $1:$line in
      quitter:"Press each button"*) exec >&- ;;
      sloppy:"Move the handle to the right"*) hold r; echo fifty; echo 5e9; echo s ;;
      ruler:"Move the handle to the right"*) hold r; echo 30 mm ;;
      lazy:*"in the middle of its workspace, then"*) echo s ;;
      *:*"in the middle of its workspace, then"*) hold m; echo ;;
      *:"Move the handle to the right"*) hold r; echo ;;
      *:"Move the handle away"*) hold a; echo ;;
      *:"Move the handle up"*) hold u; echo ;;
      *:"Press each button"*) hold m; echo ;;
      guesser:"Which way does it push?"*) await_push 2; echo r ;;
      interrupter:"Which way does it push?"*)
        await_push 2
        echo "$way" >> felt_before
        kill -TERM "$(< process)"
        sleep 1
        exec >&- ;;
      silent:"Which way does it push?"*) ;;
      silent:"The push has ended"*) cat felt >> felt_after; echo n; echo s ;;
      [sh]*:"Which way does it push?"*) echo s ;;
      *:"Which way does it push?"*)
        await_push 1
        sleep 0.3
        # Only the deaf device gives no push. Elsewhere the push is late because the machine is busy: p asks for another.
        [ "$way" != n ] || [ "${PWD##*/}" = deaf ] || way=p
        echo "$way" ;;
      *:"Touch the ball"*) hold b; await_push 5; [ "$1" = timid ] && echo t || echo Y ;;
      *:"Go into the ball"*) hold r; echo; hold b; await_push 5; echo ;;
      *:"Is there no force any more?"*) await_rest 2; [ "$way" = n ] && echo y || echo n ;;
    esac
  done 2> /dev/null
}

# touch_device FOLDER CHARACTER ARGUMENTS...: the device and the person, each with its own folder; status and output stay there. A signal to the
# process that the file `process` names reaches the program once, as timeout is in the foreground.
touch_device() {
  local at=$1 character=$2
  shift 2
  mkdir "$at" && cd "$at" || exit 1
  printf m > hand
  printf n > felt
  mkfifo answers
  bash -c 'echo $$ > process; exec timeout --foreground 240 "$@"' bash "$program" hello-device --driver "$driver" "$@" < answers 2>&1 |
    person "$character" > answers
  echo "${PIPESTATUS[0]}" > status
}

# becomes PLACES: within 20 s the motors push one of these ways; n: not at all.
becomes() {
  local i
  for ((i = 0; i < 200; ++i)); do
    [[ $(cat felt) == [$1] ]] && return
    sleep 0.1
  done
  false
}

# While the device pushes, nobody reads what the program writes, and there is no room for more.
hold_up() {
  mkdir held && cd held || exit 1
  printf m > hand
  printf n > felt
  mkfifo output
  exec 9<> output
  (printf 's\ns\n'; yes x | head -n 4000) | timeout 240 "$program" hello-device --driver "$driver" hello:right > output 2>&1 9>&- &
  becomes rlatud && becomes n && touch ended
  exec 8< output 9>&-  # in this order: opened after all who write have ended, it would wait for ever
  cat <&8 > read
  wait
}

# expect FOLDER STATUS PATTERN...: how it ended, and what its output says.
expect() {
  local at=$1 status=$2 pattern
  shift 2
  [ "$(cat "$at/status")" = "$status" ] || fail "$at ended with $(cat "$at/status"), expected $status"
  for pattern in "$@"; do
    grep -qE -e "$pattern" "$at/output" || { fail "$at does not say: $pattern"; sed 's/^/    /' "$at/output"; }
  done
}

for name in right exchanged mirrored backwards turned deaf pausing unready lost forceless; do
  touch_device $name truthful hello:$name &
done
for character in sloppy ruler guesser silent quitter hasty timid interrupter; do
  touch_device $character $character hello:right &
done
touch_device scaled hasty hello:scaled &
touch_device lazy lazy hello:mirrored &
touch_device runner silent hello:scaled &
hold_up &
touch_device weak truthful hello:right --force 2.5 &
wait

expect right 0 '^passed  a move up: the pose went along \+z by [45]' '^    seen        0, 2$' '^    status      all is well$' \
  '^passed  a force along -x should push to the left: it does, and the pose goes along -x by ' \
  '^passed  the force that is sent is 0 soon after the stop: after [0-9.]+ ms$' '^passed  after the stop there is no force$' \
  '^    rendered    at most [0-9]+ N/m, ' \
  '^passed  the hand does not chatter$' '^14 passed, 0 odd, 0 failed$' \
  '^That is no answer. Enter while you feel it push;' '^The report is in hello-hello-no_1.md.$'
grep -q '^14 passed, 0 odd, 0 failed$' right/hello-hello-no_1.md || fail "the report is not in its file"
grep -q 'Which way' right/hello-hello-no_1.md && fail "the questions are in the report"
expect exchanged 1 ': the pose went along -y by [45][0-9]?(\.[0-9])? mm: x and y are exchanged, and a sign is wrong$' \
  '^The poses are wrong: x and y are exchanged, the sign of x is wrong. Look at .* encoders' \
  '^    not tried   the poses or the forces are wrong'
expect mirrored 1 '^FAILED  a move up: the pose went along -z by .*: its sign is wrong$' \
  '^The poses are wrong: the sign of z is wrong.' \
  '^FAILED  a force along \+z should push up: it does, but the pose goes along -z by '
expect backwards 1 '^FAILED  a force along \+y should push away from you: it pushes towards you, and the pose ' \
  '^The forces are wrong: the signs of x, y, z are wrong. Look at .* motors'
expect turned 1 '^odd     it has no watchdog: a force stays when the program is killed' '^Poses and forces are turned or mirrored alike \(poses: the signs of x, y are wrong\)' '^passed  the ball is there'
expect scaled 1 'its scale is wrong by a factor of (9\.|10)' '^The poses are .* are millimetres taken for centimetres\?$'
expect deaf 1 '^The forces are wrong: nothing comes out along \+x, \+y, \+z, -x, -y, -z.'
expect pausing 0 '^14 passed, 0 odd, 0 failed$'
expect unready 1 '^odd     it is not ready: it is not homed' '^odd     the steps at the handle were not tried'
expect lost 1 '^FAILED  the device failed here: .*the cable is out$'
expect forceless 0 '^    not tried   the device has no force$' ' 0 failed; steps that were left out: 1$'
expect weak 2 '^forceserver: --force is 2.5 N, and the device gives 2 N at most$'
expect sloppy 0 '^That is no answer. Enter: it is there; or a number: ' '^    skipped     by the person$'
expect ruler 1 '^FAILED  a move to the right: .*: its scale is wrong by a factor of 1\.[4-8]'
expect guesser 1 '^The forces are wrong: the answers contradict one another'
expect lazy 1 '^    skipped     by the person$' '^The poses are wrong: the sign of z is wrong.'
expect runner 1 '^The push has ended as the handle ran 40 mm away. Which way was it\?$'
expect silent 1 '^The push has ended after 3 s. Which way was it\?$'
[ "$(cat silent/felt_after)" = n ] || fail "a push without an answer does not end"
[ -e held/ended ] || fail "a push does not end while the output is held up"
expect quitter 1 '^odd     the person gave up here$'
expect timid 1 '^FAILED  the ball is there, round, and quiet: it trembles$'
expect hasty 0 '^    not tried   the force along each axis was not tried before$'
expect interrupter 1 '^odd     it was interrupted here; the force is 0$'
[[ $(cat interrupter/felt_before interrupter/felt) == [rlatud]$'\n'n ]] || fail "an interrupted push does not end with force 0"

# The simulator, where each step is skipped; a report is never overwritten.
for report in hello-sim-sim-0.md hello-sim-sim-0-2.md; do
  printf 's\ns\ns\ns\ns\n' | "$program" hello-device sim: > output 2>&1 || fail "skipping all steps is not fine"
  grep -qE "^The report is in $report.$" output || fail "the report is not in $report"
done
"$program" hello-device sim: --report hello-sim-sim-0.md > output 2>&1 < /dev/null
[ $? = 2 ] && grep -q 'cannot write the report hello-sim-sim-0.md: File exists' output || fail "a report is overwritten"
"$program" hello-device sim: --force 5 > output 2>&1
[ $? = 2 ] && grep -q 'force' output || fail "--force 5 is not refused"
"$program" hello-device > output 2>&1
[ $? = 2 ] && grep -q '^forceserver: hello-device needs a device, such as: ' output || fail "a device is not asked for"

[ $failures = 0 ] && echo "all as expected"
exit $((failures > 0))

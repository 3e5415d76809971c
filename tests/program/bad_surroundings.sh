#!/usr/bin/env bash
# bad_surroundings.sh PROGRAM SCENE REFUSE_CALLS: forceserver where much is missing: /dev/shm, a home, a file system that can be written,
# memory, locked memory, system calls. Each time a server with a client, and forces at given positions, must work as ever, or say what
# is missing. What only root may arrange is left out for others.
set -uo pipefail
program=$1 refuse_calls=$3
scene=scene.json
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
chmod 755 "$folder"
cp "$2" "$folder/$scene"
cd "$folder" || exit 1
name=bad-$$
failures=0
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}
shows() {  # FILE PATTERN WHAT
  grep -qE -e "$2" "$1" && return
  fail "$3: no line matches /$2/ in:"
  sed 's/^/    /' "$1"
}

echo 0 0 -0.06 > positions
"$program" evaluate "$scene" positions > forces || fail "evaluate in ordinary surroundings"

# evaluates WHAT COMMAND...: the forces are the same when COMMAND runs the program.
evaluates() {
  local what=$1
  shift
  "$@" "$program" evaluate "$scene" positions > output 2>&1 || fail "$what: evaluate ended with $?"
  cmp -s forces output || { fail "$what: evaluate writes something else:"; sed 's/^/    /' output; }
}

# serves WHAT COMMAND...: a server lets in a client when COMMAND runs both, and when it runs only one of them.
serves() {
  local what=$1 server i
  shift
  : > served  # what the server before has said
  "$@" "$program" run "$scene" --listen "$name" > served 2>&1 < /dev/null &
  server=$!
  for ((i = 0; i < 100; ++i)); do
    grep -q '^listens at ' served && break
    sleep 0.1
  done
  "$@" "$program" clients "$name" > output 2>&1 || fail "$what: clients ended with $?"
  shows output '^server +[0-9]+ ' "$what"
  is_same_user "$@" && { "$program" watch "$name" --count 1 > output 2>&1; shows output '^hand ' "$what, watched from outside"; }
  kill -INT $server
  wait $server
  i=$?
  [ $i = 0 ] || grep -q 'the servo was late too long' served || fail "$what: run ended with $i"
  shows served '^faults: ' "$what"
}
is_same_user() { [ "$("$@" id -u)" = "$(id -u)" ] && [ "$("$@" readlink /proc/self/ns/net)" = "$(readlink /proc/self/ns/net)" ]; }

# refused WHAT PATTERN COMMAND...: it ends with 2 and one sentence that matches.
refused() {
  local what=$1 pattern=$2 status
  shift 2
  timeout 60 "$@" > output 2>&1 < /dev/null
  status=$?
  [ $status = 2 ] || fail "$what: ended with $status, expected 2"
  shows output "^forceserver: .*$pattern" "$what"
}

# A home that is not set. Whose user has no entry either.
no_home=(env -u HOME -u XDG_CONFIG_HOME -u XDG_RUNTIME_DIR)
evaluates "no HOME" "${no_home[@]}"
serves "no HOME" "${no_home[@]}"
if [ "$(id -u)" = 0 ] && setpriv --reuid=4242 test -x "$program" 2> /dev/null; then
  nobody=(setpriv --reuid=4242 --regid=4242 --clear-groups "${no_home[@]}")
  evaluates "a user without an entry" "${nobody[@]}"
  serves "a user without an entry" "${nobody[@]}"
fi

# No locked memory and no real-time priority.
as_nobody=(prlimit --memlock=0 --rtprio=0 --)
[ "$(id -u)" != 0 ] || as_nobody+=(setpriv --bounding-set=-all --inh-caps=-all)
evaluates "no locked memory" "${as_nobody[@]}"
serves "no locked memory" "${as_nobody[@]}"
shows served '^the system granted: nothing: an ordinary thread' "no locked memory"

# System calls that the filter of a container refuses.
if "$refuse_calls" EPERM memfd_create true; then
  for error in EPERM ENOSYS; do
    evaluates "$error" "$refuse_calls" $error memfd_create,pidfd_open
    serves "pidfd_open: $error" "$refuse_calls" $error pidfd_open
    refused "memfd_create: $error" 'shared memory .*: memfd_create is not allowed here' \
      "$refuse_calls" $error memfd_create "$program" run "$scene" --listen "$name" --duration 1
  done
fi

# Too little memory: from what the loader needs on, the program works or says what it lacks. A sanitizer needs more than there is.
if [[ $(ldd "$program") != *lib[at]san* ]]; then
  worked=0
  for megabytes in 60 80 100 130 160 200 300 500; do
    for command in "evaluate $scene positions" "run $scene --duration 0.3 --listen $name"; do
      # shellcheck disable=SC2086  # a command
      timeout 60 prlimit --as=$((megabytes * 1000000)) "$program" $command > output 2>&1 < /dev/null
      status=$?
      case $status in
        0) worked=$((worked + 1)) ;;
        1) grep -qE '^faults: [^n]' output || fail "$megabytes MB: $command ended with 1" ;;
        2) shows output '^forceserver: .*(memory|could not be started)' "$megabytes MB: $command" ;;
        127) shows output 'error while loading shared libraries' "$megabytes MB: $command" ;;
        *) fail "$megabytes MB: $command ended with $status" ;;
      esac
    done
  done
  [ $worked -ge 4 ] || fail "the program works with 500 MB $worked times"
fi

# Name spaces of one's own: no /dev/shm; nothing can be written.
if unshare --mount true 2> /dev/null; then
  mkdir dev
  cat > without_shm << 'END'
mount --make-rprivate / && mount -t tmpfs none dev && cp -a /dev/null /dev/zero /dev/urandom dev && mount --move dev /dev &&
  [ ! -e /dev/shm ] && exec "$@"
END
  without_shm=(unshare --mount sh without_shm)
  cat > only_read << 'END'
mount --make-rprivate / || exit 3
while read -r _ place _; do mount -o remount,bind,ro "$place" 2> /dev/null; done < /proc/self/mounts
! touch written 2> /dev/null && exec "$@"
END
  only_read=(unshare --mount sh only_read)
  for kind in without_shm only_read; do
    declare -n command=$kind
    if "${command[@]}" true 2> /dev/null; then
      evaluates $kind "${command[@]}"
      serves $kind "${command[@]}"
    else
      echo "left out: this system does not let root make: $kind"
    fi
  done
  if "${only_read[@]}" true 2> /dev/null; then
    refused "a record where nothing can be written" 'cannot write ticks.csv: Read-only file system' \
      "${only_read[@]}" "$program" run "$scene" --record ticks.csv --duration 1
    refused "a report where nothing can be written" 'cannot write the report .*Read-only file system' \
      "${only_read[@]}" "$program" hello-device sim:
  fi
fi

# A control group with little memory, as a container has it.
group=$(ls -d /sys/fs/cgroup/memory 2> /dev/null || echo /sys/fs/cgroup)/forceserver-$name
if mkdir "$group" 2> /dev/null; then
  limit=$group/memory.max
  [ -e "$limit" ] || limit=$group/memory.limit_in_bytes
  if echo 60000000 2> /dev/null > "$limit"; then
    # shellcheck disable=SC2016  # of the inner shell
    in_group=(sh -c 'echo $$ > "$0/cgroup.procs" && exec "$@"' "$group")
    evaluates "60 MB" "${in_group[@]}"
    serves "60 MB" "${in_group[@]}"
    "${in_group[@]}" "$program" doctor --seconds 0.1 > output 2>&1
    shows output '^    memory +limited to 60 MB by a control group, of which [0-9]+ MB are left$' "60 MB"
  fi
  rmdir "$group"
fi

echo "$failures failures"
[ $failures = 0 ]

#!/usr/bin/env bash
# interrupt.sh SOURCE_FOLDER QUICKSTART: Ctrl-C and SIGTERM. The quickstart ends its flight early and keeps the summary;
# tests/run ends at once with its children, whatever it is doing, and says so.
set -uo pipefail
source_folder=$1 quickstart=$2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
set -m  # so that what runs in the background is not deaf to the signal
failures=0
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}

# wait_for COMMAND...: repeats the command until it succeeds, for a minute at most.
wait_for() {
  local i
  for ((i = 0; i < 600; ++i)); do
    "$@" > /dev/null 2>&1 && return
    sleep 0.1
  done
  fail "waited in vain for: $*"
}

not() { ! "$@"; }

# The quickstart.
"$quickstart" --seconds 1000 > "$folder/flight" 2>&1 &
flight=$!
wait_for grep -q 'Ctrl-C' "$folder/flight"
kill -INT $flight
wait $flight
status=$?
[ $status = 0 ] || fail "the interrupted quickstart ended with $status"
for line in '^interrupted' '^who pushed' "^rover's plane " '^every tick of it' '^the force of each object' \
  '^protections switched off: none$'; do
  grep -q "$line" "$folder/flight" || fail "the interrupted quickstart has no line like $line"
done
[ $failures = 0 ] || sed 's/^/    /' "$folder/flight"

# tests/run in a folder of its own, with tools that never end.
mkdir -p "$folder/tests" "$folder/.ci" "$folder/tools"
cp "$source_folder/tests/run" "$folder/tests"
cp "$source_folder/.ci/setup.sh" "$folder/.ci"
cat > "$folder/tools/stand_in" << 'END'
#!/usr/bin/env bash
case "$0" in
  */dpkg-query) echo 'install ok installed'; exit ;;
  */"$STOPS_AT") ;;
  */ninja) echo 'one: phony'; exit ;;
  */ctest) echo 'Test #1: one'; exit ;;
  *) exit 0 ;;
esac
sleep 1000 &
echo $$ $! > "$STARTED.new" && mv "$STARTED.new" "$STARTED"
wait
END
chmod +x "$folder/tools/stand_in"
for tool in cmake ninja ctest dpkg-query; do ln -s stand_in "$folder/tools/$tool"; done
for script in tests/bindings/run_python tests/bindings/run_java tests/bindings/parity/run tests/examples/editor/run tests/style/run \
  bindings/description/make bindings/description/site/make tests/fuzz/run tests/examples/testbed/run tests/dds/run_vendors \
  tests/packages/run tests/aarch64/run tests/bench/check tests/soak/run; do
  mkdir -p "$folder/$(dirname $script)"
  ln -s "$folder/tools/stand_in" "$folder/$script"
done
for tool in cmake ninja ctest soak/run run_python editor/run fuzz/run; do
  signal=INT
  [ $tool != run_python ] || signal=TERM
  export STOPS_AT=$tool STARTED=$folder/started_${tool%/*}
  PATH=$folder/tools:$PATH "$folder/tests/run" --all > "$folder/account" 2>&1 &
  run=$!
  wait_for test -s "$STARTED"
  kill -$signal $run
  wait_for not kill -0 $run
  kill -KILL $run 2> /dev/null
  wait $run
  status=$?
  [ $status = 130 ] || fail "tests/run, interrupted in $tool, ended with $status"
  grep -q FAILED "$folder/account" && fail "tests/run, interrupted in $tool, counts a failure"
  tail -n 1 "$folder/account" | grep -q '^interrupted' || fail "tests/run, interrupted in $tool, does not say so"
  for process in $(cat "$STARTED"); do
    # It has ended, or waits for its new parent to read its status.
    if grep -q '^State:[[:space:]]*[^ZX]' "/proc/$process/status" 2> /dev/null; then
      fail "$process, a child of $tool, is left"
      kill -KILL "$process"
    fi
  done
  sed "s|^|  $tool: |" "$folder/account"
done

echo "$failures failures"
[ $failures = 0 ]

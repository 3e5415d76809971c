#!/usr/bin/env bash
# man_page.sh PROGRAM PAGE: the man page of a program is whole, and the tools that show and check man pages have nothing to say of it.
set -uo pipefail
program=$1 page=$2
shown=$(mktemp)
trap 'rm -f "$shown"' EXIT
failures=0
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}
quiet() {  # COMMAND...: it says nothing
  local said
  command -v "$1" > /dev/null || { echo "$1 is missing; not tried"; return; }
  said=$("$@" 2>&1 > /dev/null) || fail "$* ended with $?"
  [ -z "$said" ] || fail "$*: $said"
}
quiet groff -ww -man -Tutf8 "$page"
quiet man --warnings --encoding=UTF-8 --local-file "$page"
if command -v mandoc > /dev/null; then
  mandoc -T lint -W warning "$page" > "$shown" || fail "mandoc: $(cat "$shown")"
fi

# Every command and option of the help is there; each option and each command with a description is an entry of its own.
if command -v man > /dev/null; then MANWIDTH=100 man --encoding=UTF-8 --local-file "$page" | col -bx > "$shown"; else groff -man -Tascii "$page" | col -bx > "$shown"; fi
shows() { grep -qE -e "$1" "$shown" || fail "no line of the page matches /$1/"; }
shows "^$(basename "$program" | tr a-z A-Z)\(1\)"
shows "$("$program" --version)"
commands= all_options=
"$program" --help | grep -q '^Each command has its own help' && commands=$("$program" --complete "" | cut -f1)
for command in "" $commands; do
  [ -z "$command" ] || shows "^COMMAND ${command^^}$"
  [ -z "$command" ] || shows "^       $(basename "$program") $command \[OPTIONS\]"
  options=$("$program" $command --help | sed -nE 's/^  (--[a-z-]+).*/\1/p')
  all_options+=" $options"
  for option in $options; do
    shows "^       $option( |$)"
  done
done
[[ $all_options == *--* ]] || fail "no option is found in the help"
if [[ $program == *forceserver ]]; then
  [ "$(wc -w <<< "$commands")" -ge 13 ] || fail "the help shows $(wc -w <<< "$commands") commands"
  shows '^EXIT STATUS$'
  shows '^       forceserver run room\.json$'
  shows '^              the scene with a simulated device and hand, until Ctrl-C$'
  shows '^       forceserver devices$'
  [ "$(wc -l < "$shown")" -ge 60 ] || fail "the page has $(wc -l < "$shown") lines"
fi

echo "$failures failures"
[ $failures = 0 ]

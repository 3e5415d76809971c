#!/usr/bin/env bash
# completion.sh PROGRAM SOURCE_FOLDER: what bash and zsh offer when Tab is pressed after the program's name. zsh is left out where it is missing.
set -uo pipefail
program=$1 source=$2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
name=complete-$$
failures=0
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}
touch "a scene.json" another.json part:two.json

# offered WORD...: what bash offers in place of the last word.
offered() {
  local word
  COMP_WORDS=("$program") COMP_LINE="$program $*"
  for word; do  # bash divides them at : and =, too
    [ -n "$word" ] || COMP_WORDS+=("")
    mapfile -t -O ${#COMP_WORDS[@]} COMP_WORDS < <(grep -oE '[:=]|[^:=]+' <<< "$word")
  done
  COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
  COMPREPLY=()
  _forceserver "$program"
  printf '%s\n' ${COMPREPLY[@]+"${COMPREPLY[@]}"}
}
# in_zsh WORD...: what zsh offers; its functions print what they are given.
in_zsh() {
  zsh -f -c '
    fpath=("$1" $fpath)
    autoload -Uz _forceserver
    _describe() { print -lr -- "${(@P)argv[-1]}"; }
    _files() { print -lr -- *; }
    compset() { }
    words=("${@[2,-1]}") CURRENT=$#words
    _forceserver' zsh "$folder/site-functions" "$program" "$@"
}
offers() {  # SHELL LINES WORD...: it offers these lines, in this order
  local shell=$1 wanted=$2 found
  shift 2
  found=$($shell "$@" 2>&1)
  [ "$found" = "$wanted" ] || fail "$shell $*: offers '$found', expected '$wanted'"
}

: > served
"$program" run --listen "$name" > served 2>&1 < /dev/null &
server=$!
for _ in $(seq 100); do
  grep -q '^listens at ' served && break
  sleep 0.1
done

# Each command of the help, and each option of each command.
commands=$("$program" --help | awk 'tolower($0) == "subcommands:" {on = 1; next} /^$/ {on = 0} on {print $1}')
[ "$(wc -w <<< "$commands")" -ge 13 ] || fail "the help shows $(wc -w <<< "$commands") commands"
source "$source/completion.bash"
[ "$(complete -p forceserver)" = "complete -F _forceserver forceserver" ] || fail "bash does not know the completion"
offers offered "$commands" ""
offers offered $'devices\ndoctor' d
for command in $commands; do
  offers offered "$("$program" "$command" --help | sed -nE 's/^  (-h,)?(--[a-z-]+).*/\2/p')" "$command" --
done
offers offered $'--help\n--version' --
offers offered --listen run --li
offers offered $'a scene.json\nanother.json' run a
offers offered another.json run another
offers offered another.json run --duration 1 another
offers offered another.json evaluate x.json another
offers offered another.json run --record another
offers offered another.json run --record=another
offers offered $'a scene.json\nanother.json' run --record=a
offers offered another.json run --device sim:?hand=firm another
offers offered another.json run --device=sim:?hand=firm another
offers offered another.json evaluate --nonsense x.json another
offers offered two.json run part:t
offers offered two.json run --record=part:t
offers offered "" run --duration ""
offers offered "" run x.json ""
offers offered "$name" watch "${name%?}"
offers offered "$name" clients --json "${name%?}"
offers offered sim: run --device s
offers offered sim: run --device=s
offers offered "" run --device sim:
offers offered "" run --device sim:ro
offers offered "" nonsense ""
offers offered "" watch "$name" ""

if command -v zsh > /dev/null; then
  mkdir site-functions
  cp "$source/completion.zsh" site-functions/_forceserver
  known=$(zsh -f -c 'fpath=("$1" $fpath); autoload -Uz compinit; compinit -u -d "$1/../dump"; print -r -- "$_comps[forceserver]"' zsh "$folder/site-functions")
  [ "$known" = _forceserver ] || fail "zsh does not find the completion: '$known'"
  offers in_zsh "clients:List who is connected to a server" cl
  offers in_zsh '--listen:Let other programs connect; NAME lab is the endpoint shm:lab' run --li
  offers in_zsh 'sim\:' run --device s
  offers in_zsh 'sim\:' run --device=s
  offers in_zsh "$name" watch "${name%?}"
  in_zsh run "" > found
  grep -qFx "a scene.json" found || fail "zsh offers no files"
  in_zsh run --device=sim: "" > found
  grep -qFx "a scene.json" found || fail "zsh offers no files after an option with its value"
  offers in_zsh "" run --duration ""
fi
kill -INT $server
wait $server

echo "$failures failures"
[ $failures = 0 ]

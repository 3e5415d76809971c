# Completion of the words after `forceserver` in bash: the program itself knows them.
_forceserver() {
  local word IFS=$'\n' words=()
  # bash takes the = of --device=sim: for a word of its own.
  for word in "${COMP_WORDS[@]:1:COMP_CWORD}"; do
    [ "$word" = = ] || words+=("$word")
  done
  [ "${COMP_WORDS[COMP_CWORD]}" != = ] || words+=("")
  COMPREPLY=()
  while read -r word; do
    word=${word%%$'\t'*}
    if [ "$word" = :files ]; then
      compopt -o filenames 2> /dev/null
      COMPREPLY+=($(compgen -f -- "${words[-1]-}"))
    else
      COMPREPLY+=("$word")
      [[ $word != *: ]] || compopt -o nospace 2> /dev/null
    fi
  done < <("${1/#\~/$HOME}" --complete "${words[@]}" 2> /dev/null)
}
complete -F _forceserver forceserver

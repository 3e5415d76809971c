# Completion of the words after `forceserver` in bash: the program itself knows them.
_forceserver() {
  local rest=$COMP_LINE word between current value option piece IFS=$'\n' words=()
  # bash divides sim:?hand=firm at : and =, too.
  for word in "${COMP_WORDS[@]:0:COMP_CWORD+1}"; do
    between=${rest%%"$word"*}
    rest=${rest#"$between$word"}
    if [[ -z $between && -n $word && ${#words[@]} != 0 && ($word == [:=]* || ${words[-1]} == *[:=]) ]]; then
      words[-1]+=$word
    else
      words+=("$word")
    fi
  done
  current=${words[-1]} value=$current
  [[ $current != --*=* ]] || value=${current#*=}
  option=${current%"$value"} piece=${COMP_WORDS[COMP_CWORD]}
  [[ $piece != [:=]* ]] || piece=
  COMPREPLY=()
  while read -r word; do
    word=${word%%$'\t'*}
    if [ "$word" = :files ]; then
      compopt -o filenames 2> /dev/null
      COMPREPLY+=($(compgen -f -- "$value"))
    else
      COMPREPLY+=("$word")
      [[ $word != *: ]] || compopt -o nospace 2> /dev/null
    fi
  done < <("${1/#\~/$HOME}" --complete "${words[@]:1}" 2> /dev/null)
  # Only what stands in the place of the last piece.
  for word in "${!COMPREPLY[@]}"; do
    COMPREPLY[word]=$option${COMPREPLY[word]}
    COMPREPLY[word]=${COMPREPLY[word]:${#current}-${#piece}}
  done
}
complete -F _forceserver forceserver

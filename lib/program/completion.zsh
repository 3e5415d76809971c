#compdef forceserver
# Completion of the words after `forceserver` in zsh: the program itself knows them.
local line word description
local -a offers
local -i status_=1
local -a lines=("${(@f)$("${words[1]/#\~/$HOME}" --complete "${(@)words[2,CURRENT]}" 2> /dev/null)}")
[[ ${words[CURRENT]} != --*=* ]] || compset -P 1 '--*='
for line in "${(@)lines}"; do
  word=${line%%$'\t'*}
  description=${line#"$word"}
  if [[ $word == :files ]]; then
    _files && status_=0
  elif [[ -n $word ]]; then
    offers+=("${word//:/\\:}${description:+:${description#$'\t'}}")
  fi
done
(( $#offers )) && _describe -V forceserver offers && status_=0
return status_

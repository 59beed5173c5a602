#compdef fledge
# SPDX-License-Identifier: Apache-2.0
# Completes fledge's commands in bash and zsh, by what `fledge completion -- WORD...` prints; file names where it
# prints nothing. Source it, or put it where the shell looks: for zsh, under the name _fledge.
if [ -n "${ZSH_VERSION-}" ]; then
    _fledge() {
        local -a found
        found=(${(f)"$("${words[1]/#\~/$HOME}" completion -- "${(@)words[2,CURRENT]}" 2>/dev/null)"})
        if [ ${#found} -gt 0 ]; then compadd -- "${found[@]}"; else _files; fi
    }
    if [ "${funcstack[1]}" = _fledge ]; then
        _fledge
    else
        whence compdef >/dev/null || { autoload -Uz compinit && compinit; }
        compdef _fledge fledge
    fi
else
    _fledge() {
        local words last IFS=$' \t\n'
        read -ra words <<< "${COMP_LINE:0:COMP_POINT}."     # a dot after the cursor: the last word may be empty
        last=${words[-1]%.} IFS=$'\n'
        COMPREPLY=($("${words[0]/#\~/$HOME}" completion -- "${words[@]:1:${#words[@]}-2}" "$last" 2>/dev/null))
        COMPREPLY=("${COMPREPLY[@]#"${last%"${last##*[=:]}"}"}")    # bash replaces what is behind a = or : alone
    }
    complete -o default -F _fledge fledge
fi

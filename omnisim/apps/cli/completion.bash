# Bash takes : and = for ends of words, and completes either names or files by itself. COMP_WORDS is
# therefore the line up to the cursor; what stands before a : stays, and COMP_CWORD is the last word.
_omnisim_completion() {
    local IFS=$'\n' line="${COMP_LINE:0:COMP_POINT}" item file files= before=
    local given="${line##*[[:blank:]]}"
    [[ -z $given ]] && line+="''"
    given="${given##*=}"
    [[ $COMP_WORDBREAKS == *:* && $given == *:* ]] && before="${given%:*}:"
    for item in $(env COMP_WORDS="$line" COMP_CWORD=-1 _OMNISIM_COMPLETE=bash_complete "$1"); do
        if [[ $item == plain,* ]]; then
            item="${item#plain,}"
            COMPREPLY+=("${item#"$before"}")
        else
            files="${item%%,*}"
        fi
    done
    if [[ -n $files && ${#COMPREPLY[@]} == 0 ]]; then
        [[ $files == dir ]] && compopt -o dirnames || compopt -o default
    elif [[ -n $files ]]; then
        for file in $(compgen "-${files:0:1}" -- "$given"); do
            [[ -d $file ]] && file+=/
            COMPREPLY+=("$(printf %q "${file#"$before"}")")
        done
    fi
    [[ ${#COMPREPLY[@]} == 1 && ${COMPREPLY[0]} == *[:/] ]] && compopt -o nospace
    return 0
}
complete -o nosort -F _omnisim_completion omnisim

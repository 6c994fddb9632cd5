#!/bin/sh
# Trains a bundle's run on a machine with Python, pip and JAX, without a network.
#
#     sh run.sh [MINUTES]
#
# It lies beside the bundle's pieces, or among what was unpacked from them. While it runs and when
# it ends, result/ holds what is to be brought home: weights, curves and config in run.tar.gz.*
# (`cat run.tar.gz.* | tar -xz`), which are of at most 16 MB each, log.txt, timing.txt, and at the
# end evaluation.json. PYTHON=... names another Python than python3.

# SETTINGS

here=$(cd "$(dirname "$0")" && pwd)
work=$here/work
run=$work/run
result=$here/result
began=$(date +%s)
python=${PYTHON:-python3}
all=${1:-$MINUTES}

fail() {
    echo "error: $*" >&2
    exit 1
}

seconds() { # since the beginning
    echo $(($(date +%s) - began))
}

note() { # what happened, with the time at which it did
    echo "$(seconds) s: $*" | tee -a "$work/timing.txt"
}

check_arguments() {
    case $all in
    '' | *[!0-9.]* | *.*.*)
        echo "usage: sh run.sh [MINUTES]" >&2
        exit 2
        ;;
    esac
    mkdir -p "$work" || fail "$here cannot be written to: copy the bundle to another folder"
}

check_python() {
    command -v "$python" >/dev/null ||
        fail "$python is missing: install Python $PYTHON_VERSION, or set PYTHON to where it is"
    version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
    [ "$version" = "$PYTHON_VERSION" ] ||
        fail "$python is Python $version, and the bundle's wheels are for $PYTHON_VERSION: set" \
            "PYTHON to such a Python, or pack the bundle with --python $version"
    "$python" -m pip --version >/dev/null 2>&1 ||
        fail "$python has no pip: install it, or set PYTHON to a Python that has it"
    device=$("$python" -P -c 'import jax
print(jax.default_backend(), jax.__version__, jax.devices()[0].device_kind)' 2>"$work/jax.txt") ||
        fail "$python cannot use JAX ($(tail -n 1 "$work/jax.txt")): install it, or set PYTHON to" \
            "a Python that has it"
    note "Python $version, JAX on $device"
    case $device in
    cpu*) echo "warning: JAX finds no GPU and trains on the processor, in which few batches fit" >&2 ;;
    esac
}

check_disk() {
    free=$(df -Pk "$here" | awk 'NR == 2 { print $4 }')
    [ "$free" -ge "$NEEDED_KB" ] ||
        fail "the disk of $here has $((free / 1024)) MB left, and $((NEEDED_KB / 1024)) are needed:" \
            "make room, or copy the bundle to another disk"
}

check_pieces() {
    [ -f "$here/index.txt" ] || fail "$here/index.txt is missing: copy it there with the pieces"
    while read -r digest size name; do
        [ -f "$here/$name" ] || fail "$here/$name is missing: copy all of the bundle's pieces there"
        found=$(sha256sum <"$here/$name" | cut -d ' ' -f 1)
        [ "$found" = "$digest" ] ||
            fail "$here/$name has a wrong checksum, and $(wc -c <"$here/$name") of $size bytes:" \
                "copy it again"
    done <"$here/index.txt"
}

unpack() {
    files=$here
    [ -d "$files/banks" ] && return
    files=$work/files
    [ -d "$files" ] && return
    check_disk
    check_pieces
    rm -rf "$files.partial"
    mkdir "$files.partial"
    cut -d ' ' -f 3 "$here/index.txt" | (cd "$here" && xargs cat) | tar -xzf - -C "$files.partial" ||
        fail "the pieces cannot be unpacked into $files.partial: is the disk full?"
    mv "$files.partial" "$files"
    note "pieces checked and unpacked"
}

install_wheels() {
    site=$work/site
    PYTHONPATH=$site${PYTHONPATH:+:$PYTHONPATH}
    export PYTHONPATH
    [ -d "$site" ] && return
    rm -rf "$site.partial"
    "$python" -m pip --disable-pip-version-check install --quiet --root-user-action ignore \
        --no-cache-dir --no-index --no-deps --no-compile --target "$site.partial" \
        "$files"/wheels/*.whl || fail "the wheels cannot be installed in $site.partial"
    mv "$site.partial" "$site"
    note "wheels installed"
}

keep() { # what there is of the run, in place of what was kept before
    partial=$here/partial-result
    rm -rf "$partial"
    mkdir "$partial" || return
    parts=
    for part in config.json evaluation.json curves model; do
        [ -e "$run/$part" ] && parts="$parts $part"
    done
    if [ -n "$parts" ]; then
        # This fails if the model is being replaced at this moment: then it is kept the next time.
        tar -cf "$work/run.tar" -C "$run" $parts 2>/dev/null &&
            gzip -nf "$work/run.tar" &&
            split -b 16000000 "$work/run.tar.gz" "$partial/run.tar.gz." || return
    fi
    [ -f "$run/evaluation.json" ] && cp "$run/evaluation.json" "$partial"
    [ -f "$work/log.txt" ] && tr '\r' '\n' <"$work/log.txt" | tail -c 1000000 >"$partial/log.txt"
    cp "$work/timing.txt" "$partial" || return
    rm -rf "$result"
    mv "$partial" "$result"
}

train() {
    if [ -f "$work/minutes" ]; then
        minutes=$(cat "$work/minutes")
        echo "The run in $work goes on, of $minutes minutes in all; remove $work to begin anew."
    else
        # A hundredth and 15 s are left to pack the result and to stop.
        minutes=$(awk -v all="$all" -v spent="$(seconds)" \
            'BEGIN { printf "%.2f", 0.99 * all - (spent + 15) / 60 }')
        case $minutes in
        -* | 0.00) fail "$all minutes are too short: $(seconds) s have passed before the training" ;;
        esac
    fi
    eval "set -- $OPTIONS"
    [ -d "$files/start-from" ] && set -- "$@" --start-from "$files/start-from"
    set -- "$@" --out "$run" --minutes "$minutes"
    for bank in "$files"/banks/*; do
        set -- "$@" "$bank"
    done
    note "lime-train $*"
    KERAS_BACKEND=jax TQDM_MININTERVAL=5 "$python" -P -c \
        'import sys; from lime_keras.train.cli import main; sys.exit(main())' \
        "$@" >>"$work/log.txt" 2>&1 &
    trainer=$!
    stopped=
    trap 'stopped="it was stopped"; kill "$trainer" 2>/dev/null' HUP INT TERM
    end=$(awk -v all="$all" 'BEGIN { printf "%d", 60 * all - 5 }')
    : >"$work/kept"
    while kill -0 "$trainer" 2>/dev/null; do
        sleep 1
        # The run's record is there as soon as the minutes are known to be enough.
        [ -f "$run/config.json" ] && [ ! -f "$work/minutes" ] && echo "$minutes" >"$work/minutes"
        if [ "$run/model/training.json" -nt "$work/kept" ] && keep; then
            touch "$work/kept"
            note "weights in $result"
        fi
        if [ "$(seconds)" -ge "$end" ] && [ -z "$stopped" ]; then
            stopped="its time was up"
            kill "$trainer" 2>/dev/null
        fi
    done
    wait "$trainer"
    status=$?
}

finish() {
    if [ "$status" -eq 0 ]; then
        note "trained"
        stopped=
    elif [ -n "$stopped" ]; then
        note "$stopped; run it again to go on from the last checkpoint"
    else
        note "failed: $(tr '\r' '\n' <"$work/log.txt" | grep -v '^$' | tail -n 1)"
    fi
    keep || fail "$result cannot be written: is the disk full? The run is in $run"
    echo "$(du -sk "$result" | cut -f 1) kB in $result:"
    ls "$result"
    exit "$status"
}

check_arguments
check_python
unpack
install_wheels
train
finish

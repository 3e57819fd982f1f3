#!/bin/sh
# Writes made-up rows to FOLDER, and times `elm fit` and the Python programs beside it, THREADS threads each.
#     benches/run.sh FOLDER THREADS PYTHON
# from elm-datafusion/, after `cargo build --release --examples --bins`. PYTHON has numpy, pyarrow, scikit-learn.
set -eu
folder=$1 threads=$2 python=$3 release=${CARGO_TARGET_DIR:-target}/${PROFILE:-release}
timed() {
    echo "\$ $*"
    "$python" - "$@" <<'PROGRAM'
import resource, subprocess, sys, time
start = time.perf_counter()
code = subprocess.run(sys.argv[1:]).returncode
usage = resource.getrusage(resource.RUSAGE_CHILDREN)
print(f"    {time.perf_counter() - start:.2f} s, peak {usage.ru_maxrss // 1024} MB, status {code}")
PROGRAM
}
[ -d "$folder/rows" ] || "$release/examples/make_rows" "$folder/rows" 1000000 20 8
[ -d "$folder/groups" ] || "$release/examples/make_rows" "$folder/groups" 1000000 6 8 1000
rows="$folder/rows/*.parquet" groups="$folder/groups/*.parquet"
fit="$release/elm fit --threads $threads --target y"
timed $fit "$rows" --neurons 500 -o "$folder/a.elm"
timed $fit "$rows" --neurons 500 --lambda 1e-6 -o "$folder/b.elm"
timed "$python" benches/sums_numpy.py "$rows" 500 "$threads"
timed $fit "$groups" --group-by sensor --neurons 60 -o "$folder/groups.parquet"
timed $fit "$groups" --group-by sensor --neurons 60 --lambda 1e-6 -o "$folder/groups.parquet"
timed "$python" benches/groups_sklearn.py "$groups" 60

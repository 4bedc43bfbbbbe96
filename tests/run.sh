#!/bin/sh
# Installs what is missing, builds, and runs the whole suite. Ends with "N passed, N failed, N skipped".
#   --asan   under AddressSanitizer and UndefinedBehaviorSanitizer
#   --full   every count that the acceptance points name (fuzzing in the 100,000s, all poses)
#   --clang  with clang instead of gcc
set -eu
here=$(cd "$(dirname "$0")/.." && pwd)
kind=release
compiler=
options=
full=
for argument in "$@"; do
    case $argument in
    --asan) kind=asan options="-DSV_ASAN=ON" ;;
    --clang) kind=clang compiler="-DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++" ;;
    --full) full=1 ;;
    *) echo "tests/run.sh: unknown argument $argument (--asan, --full, --clang)" >&2; exit 2 ;;
    esac
done
"$here/deploy/install-packages.sh"
build=${SILVISTA_BUILD:-$here/build-$kind}
# shellcheck disable=SC2086 # lists of words
cmake -S "$here" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release $compiler $options >/dev/null
ninja -C "$build" >"$build/ninja.log" 2>&1 || { tail -n 60 "$build/ninja.log" >&2; echo "0 passed, 1 failed"; exit 1; }

export SILVISTA_CACHE_DIR="$build/cache"
export SV_TEST_FULL="${full:-0}"
# Libraries keep a few blocks for the life of the process; tests/leaks.supp names them.
export LSAN_OPTIONS="suppressions=$here/tests/leaks.supp:print_suppressions=0"
export ASAN_OPTIONS="detect_stack_use_after_return=1:abort_on_error=0:allocator_may_return_null=1"
log=$build/ctest.log
status=0
ctest --test-dir "$build" --output-on-failure -j 2 >"$log" 2>&1 || status=$?
cat "$log"
# A cmocka program that skipped cases says so in its own output; ctest counts whole programs.
passed=$(grep -cE '^ *[0-9]+/[0-9]+ Test +#.*Passed' "$log" || true)
skipped=$(grep -cE '^ *[0-9]+/[0-9]+ Test +#.*\*\*\*Skipped' "$log" || true)
failed=$(grep -cE '^ *[0-9]+/[0-9]+ Test +#.*(\*\*\*Failed|\*\*\*Timeout|\*\*\*Exception|\*\*\*Not Run)' "$log" || true)
[ "$status" -eq 0 ] || [ "$failed" -gt 0 ] || failed=1
[ "$passed" -gt 0 ] || failed=$((failed + 1))
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]

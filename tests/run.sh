#!/usr/bin/env bash
# All tests, as `make test` runs them: two workers for the most part, then the browser tests one by
# one, because a page rendered in software wants both cores. Arguments go to pytest.
set -euo pipefail
cd "$(dirname "$0")/.."

python=.venv/bin/python
chromium=${CHROMIUM:-/usr/bin/chromium}
install="apt-get update && apt-get install -y --no-install-recommends chromium"
logs=$(mktemp -d)
trap 'rm -rf "$logs"' EXIT

if [[ ! -x $chromium && -z ${CHROMIUM:-} && $(id -u) == 0 ]] && command -v apt-get >/dev/null; then
  echo "Installing chromium for the browser tests ..."
  DEBIAN_FRONTEND=noninteractive bash -c "$install" >"$logs/apt" 2>&1 || tail -n 5 "$logs/apt" >&2
fi

status=0
ran=false
run() { # run NAME pytest-arguments...
  local log=$logs/$1.pytest code=0
  shift
  "$python" -m pytest --durations=8 --durations-min=2 "$@" | tee "$log" || code=$?
  case $code in
    0) ran=true ;;
    5) ;; # nothing collected: fine for one of the two runs when the arguments choose tests
    *) ran=true status=1 ;;
  esac
}

run main -m "not browser" -n 2 "$@"
if [[ -x $chromium ]]; then
  # A Chromium that dies by itself (seen once in a hundred runs) is no verdict on the page: its test
  # runs again in a new one, and is counted as a rerun. A page that kills it twice fails.
  run browser -m browser --reruns 1 --only-rerun "browser has been closed" "$@" -n 0
fi

# One line that counts everything, in pytest's own form, for whoever reads only the end.
tail -qn 1 "$logs"/*.pytest | awk '
  { for (i = 2; i <= NF; i++) {
      word = $i; sub(/,$/, "", word); sub(/^error$/, "errors", word)
      if ($(i - 1) == "in") seconds += word
      else if ($(i - 1) ~ /^[0-9]+$/ && word != "deselected") {
        if (!(word in n)) order[++k] = word
        n[word] += $(i - 1)
      } } }
  END { for (j = 1; j <= k; j++) line = line (j > 1 ? ", " : "") n[order[j]] " " order[j]
        if (!k) line = "no tests ran"
        printf "\nAll together:\n===== %s in %.2fs =====\n", line, seconds }'

if [[ ! -x $chromium ]]; then
  printf '%s\n' '' \
    "##########  THE BROWSER TESTS DID NOT RUN: there is no $chromium  ##########" \
    "Install it as root:  $install" \
    "or name another Chromium:  CHROMIUM=/path/to/chromium make test"
  [[ ${CI:-} != true ]] || status=1
fi
$ran || status=5
exit "$status"

#!/usr/bin/env bash
# Counts the instructions of single control ticks with callgrind:
#     tests/stress/instruction_count.sh PROGRAM FOLDER
# PROGRAM is random_ticks; FOLDER takes callgrind's files. Fails if the most expensive of 1000 ticks
# takes more than 1.3 times the median, joint or Cartesian. With gains, frame and mode that change
# at every tick the ratio is printed as well: to the median of the same ticks, and of settled ones.
# Then ticks that find the modes: followed, standing still, and lost, where nothing can be followed:
# their most expensive tick may take 10 medians of followed ones, and no more.
set -euo pipefail
program=$1 folder=$2 ticks=1000 skip=20 status=0 settled=0 followed=0
for kind in joint cartesian blend modes still lost; do
  rm -f "$folder"/ticks.out*
  valgrind -q --tool=callgrind --callgrind-out-file="$folder/ticks.out" \
    --toggle-collect='dashpot::controller::ControllerCore::update(*' \
    --dump-before=end_of_tick "$program" "$kind" $((ticks + skip))
  # One file a tick, with its total; the first ticks start the springs.
  read -r least median most < <(
    for ((i = skip + 1; i <= skip + ticks; ++i)); do
      sed -n 's/^\(totals\|summary\): //p' "$folder/ticks.out.$i" | tail -n 1
    done | sort -n | awk '{ count[NR] = $1 } END { print count[1], count[int((NR + 1) / 2)], count[NR] }')
  rm -f "$folder"/ticks.out*
  [[ $kind != modes ]] || followed=$median
  awk -v kind="$kind" -v l="$least" -v m="$median" -v w="$most" -v settled="$settled" \
    -v followed="$followed" 'BEGIN {
    printf "%-9s instructions a tick: least %d, median %d, most %d = %.3f medians", kind, l, m, w, w / m
    if (kind == "blend") printf ", %.3f of settled Cartesian ticks", w / settled
    if (kind == "lost") printf ", %.3f of followed ones", w / followed
    printf "\n"
    if (kind == "lost") exit w > 10 * followed
    exit (kind == "joint" || kind == "cartesian") && w > 1.3 * m }' || status=1
  settled=$median
done
exit $status

#!/usr/bin/env bash
# Counts instructions with callgrind:
#     benchmarks/instruction_count.sh PROGRAMS FOLDER
# PROGRAMS is the folder of random_ticks; FOLDER takes callgrind's files.
# It counts control ticks, and fails if the most expensive of 1000 takes more than 1.3 times the median, joint or
# Cartesian. With gains, frame and mode that change at every tick the ratio is printed as well: to the
# median of the same ticks, and of settled ones. Then ticks that find the modes: followed, standing
# still, and lost, where nothing can be followed: their most expensive tick may take 10 medians of
# followed ones, and no more.
set -euo pipefail
programs=$1 folder=$2 status=0

count() { # FUNCTION PROGRAM ARG...: instructions in the function, of each tick if it ends ticks
  local file files
  rm -f "$folder"/callgrind.out*
  valgrind -q --tool=callgrind --callgrind-out-file="$folder/callgrind.out" \
    --toggle-collect="$1" --dump-before=end_of_tick "$programs/$2" "${@:3}" >"$folder/said"
  # One file a tick, with its total, and one without a number for what comes last.
  mapfile -t files < <(find "$folder" -name 'callgrind.out.*' | sort -V)
  ((${#files[@]})) || files=("$folder/callgrind.out")
  for file in "${files[@]}"; do sed -n 's/^\(totals\|summary\): //p' "$file" | tail -n 1; done
  rm -f "$folder"/callgrind.out*
}

count_ticks() {
  local kind ticks=1000 skip=20 settled=0 followed=0 least median most
  for kind in joint cartesian blend modes still lost; do
    # The first ticks start the springs.
    read -r least median most < <(
      count 'dashpot::controller::ControllerCore::update(*' random_ticks "$kind" $((ticks + skip)) |
        tail -n +$((skip + 1)) | sort -n |
        awk '{ count[NR] = $1 } END { print count[1], count[int((NR + 1) / 2)], count[NR] }')
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
}

count_ticks
exit $status

#!/usr/bin/env bash
# Counts instructions with callgrind:
#     benchmarks/instruction_count.sh PROGRAMS FOLDER [TRIALS]
# PROGRAMS is the folder of random_ticks, gain_ticks and sim_ticks; FOLDER takes callgrind's files.
# It counts control ticks, and fails if the most expensive of 1000 takes more than 1.3 times the median, joint or
# Cartesian. With gains, frame and mode that change at every tick the ratio is printed as well: to the
# median of the same ticks, and of settled ones. Then ticks that find the modes: followed, standing
# still, and lost, where nothing can be followed: their most expensive tick may take 10 medians of
# followed ones, and no more.
# It counts ticks with the worst of all gains that are accepted: a search of TRIALS gains comes first, then
# ticks with the worst it found and with random ones are counted. Fails if the most expensive of these
# takes more than 10 times the median of ticks whose modes are followed.
# It counts simulated periods: what each part of a scene costs. It fails unless a scene without the part takes
# fewer instructions than one with.
set -euo pipefail
programs=$1 folder=$2 trials=${3:-2000} status=0

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

count_gains() {
  local joints followed ticks median worst gains line
  local update='dashpot::controller::ControllerCore::update(*'
  for joints in 7 16; do
    followed=$(count "$update" gain_ticks "$joints" followed 120 |
      tail -n 100 | sort -n | sed -n 50p)
    "$programs/gain_ticks" "$joints" search "$trials" >"$folder/gains.txt"
    count "$update" gain_ticks "$joints" replay <"$folder/gains.txt" >"$folder/gains.counts"
    paste "$folder/gains.counts" "$folder/said" | sort -n >"$folder/gains.sorted"
    ticks=$(wc -l <"$folder/gains.counts")
    median=$(sed -n "$(((ticks + 1) / 2))p" "$folder/gains.sorted" | cut -f 1)
    read -r worst gains < <(tail -n 1 "$folder/gains.sorted")
    line=${gains#line } line=${line%%[^0-9]*}
    echo "$joints joints: instructions a tick: followed $followed (median); $ticks ticks with" \
      "$(wc -l <"$folder/gains.txt") gains, sought and random: median $median, most $worst"
    awk -v w="$worst" -v f="$followed" 'BEGIN { printf "  most: %.2f medians of followed ticks", w / f
      exit w > 10 * f }' || status=1
    printf ', with %s\n  kind, task, axes, seeds, exponents: %s\n' "$gains" \
      "$(sed -n "${line}p" "$folder/gains.txt")"
    # Work is counted in units of about one instruction.
    awk '{ match($0, /[0-9]+ units/); u = substr($0, RSTART, RLENGTH) + 0
      if (u > 100000) { r = $1 / u; n++; sum += r; if (r > most) most = r } }
      END { if (n) printf "  instructions for a unit of work: %.2f in the mean of %d ticks, %.2f at most\n",
        sum / n, n, most }' "$folder/gains.sorted"
  done
}

count_scenes() {
  local ticks=200 bare kind extra
  scene() { count 'dashpot::sim::Plant::step(*' sim_ticks "$1" $ticks; }
  bare=$(scene bare)
  printf '%-12s %8d instructions a period\n' bare $((bare / ticks))
  for kind in $("$programs/sim_ticks"); do
    [[ $kind != bare ]] || continue
    extra=$((($(scene "$kind") - bare) / ticks))
    printf '%-12s %+8d\n' "$kind" "$extra"
    ((extra > 0)) || status=1
  done
}

count_ticks
count_gains
count_scenes
exit $status

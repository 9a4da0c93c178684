#!/usr/bin/env bash
# Counts the instructions of control ticks with the worst of all gains that are accepted:
#     tests/stress/gain_count.sh PROGRAM FOLDER [TRIALS]
# PROGRAM is gain_ticks; FOLDER takes callgrind's files. A search of TRIALS gains comes first, then
# callgrind counts ticks with the worst it found and with random ones. Fails if the most expensive of
# these takes more than 10 times the median of ticks whose modes are followed.
set -euo pipefail
program=$1 folder=$2 trials=${3:-2000} status=0

count() { # JOINTS ARG...: instructions of each tick, one a line
  rm -f "$folder"/gains.out*
  valgrind -q --tool=callgrind --callgrind-out-file="$folder/gains.out" \
    --toggle-collect="dashpot::controller::ControllerCore::update(*" \
    --dump-before=end_of_tick "$program" "$@" >"$folder/gains.said"
  for ((i = 1; ; ++i)); do
    [[ -e $folder/gains.out.$i ]] || break
    sed -n 's/^\(totals\|summary\): //p' "$folder/gains.out.$i" | tail -n 1
  done
  rm -f "$folder"/gains.out*
}

for joints in 7 16; do
  # The first ticks start the springs.
  followed=$(count "$joints" followed 120 | tail -n 100 | sort -n | sed -n 50p)
  "$program" "$joints" search "$trials" >"$folder/gains.txt"
  count "$joints" replay <"$folder/gains.txt" >"$folder/gains.counts"
  paste "$folder/gains.counts" "$folder/gains.said" | sort -n >"$folder/gains.sorted"
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
exit $status

#!/usr/bin/env bash
# What each part of a scene costs the simulator, in instructions a period, with callgrind:
#     tests/stress/sim_instruction_count.sh PROGRAM FOLDER
# PROGRAM is sim_ticks. Fails unless a scene without the part takes fewer instructions than one with.
set -euo pipefail
program=$1 folder=$2 ticks=200 status=0
count() { # KIND: instructions of a period
  valgrind -q --tool=callgrind --callgrind-out-file="$folder/sim.out" \
    --toggle-collect='dashpot::sim::Plant::step(*' "$program" "$1" "$ticks" 2>/dev/null
  sed -n 's/^\(totals\|summary\): //p' "$folder/sim.out" | tail -n 1
}
bare=$(count bare)
printf '%-12s %8d instructions a period\n' bare $((bare / ticks))
for kind in $("$program"); do
  [[ $kind != bare ]] || continue
  extra=$((($(count "$kind") - bare) / ticks))
  printf '%-12s %+8d\n' "$kind" "$extra"
  ((extra > 0)) || status=1
done
rm -f "$folder/sim.out"
exit $status

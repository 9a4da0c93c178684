# Draws a struck arm with and without springs that hold its posture: gnuplot -e "dir='build/demo'" push.gp
# dir/push.txt holds time (s), and for two joints the angle (deg) free, free as predicted, and held.

set style line 1 lc rgb '#1f5fa8' lw 2
set style line 2 lc rgb '#d95f02' lw 2 dt (6, 6)
set style line 3 lc rgb '#777777' lw 2
set grid lc rgb '#dddddd'
set border lc rgb '#555555'
set key right center
set xrange [0:4]
set xlabel 'time, s'
set ylabel 'from the start, deg'

do for [kind in 'svg png'] {
  if (kind eq 'svg') {
    set terminal svg size 860,420 background rgb 'white' font 'sans-serif,13'
  } else {
    set terminal pngcairo size 860,420 background rgb 'white' font 'sans,11'
  }
  set output dir.'/push.'.kind
  set multiplot layout 1,2 title 'Panda whose elbow is struck: it stays on its zero mode, or springs bring it back'
  do for [joint in '1 3'] {
    first = joint eq '1' ? 2 : 5
    set title 'joint '.joint
    plot dir.'/push.txt' using 1:first with lines ls 1 title 'free, simulated', \
         '' using 1:(column(first + 1)) with lines ls 2 title 'free, predicted', \
         '' using 1:(column(first + 2)) with lines ls 3 title 'posture held'
  }
  unset multiplot
  unset output
}

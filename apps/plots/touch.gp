# Draws an arm that presses onto three tables in turn: gnuplot -e "dir='build/demo'; limit='2.38e+05'" touch.gp
# dir/touch.csv is what dashpot run sim/scenes/touch.yaml writes; limit (N/m) is that of dashpot contact.

set datafile separator ','
set style line 1 lc rgb '#1f5fa8' lw 1
set grid lc rgb '#dddddd'
set border lc rgb '#555555'
set xrange [0:7.5]
set yrange [0:*]
set xlabel 'time, s'
set ylabel 'force on the tip, N'
set arrow from 5, graph 0 to 5, graph 1 nohead lw 2 lc rgb '#d62728'
set label 'limit '.limit.' N/m' at 4.93, graph 0.95 right textcolor rgb '#d62728'
set label '10^4 N/m' at 1.1, graph 0.6 center
set label '10^5 N/m' at 3.6, graph 0.6 center
set label '10^6 N/m' at 6.1, graph 0.6 center

do for [kind in 'svg png'] {
  if (kind eq 'svg') {
    set terminal svg size 860,330 background rgb 'white' font 'sans-serif,13' enhanced
  } else {
    set terminal pngcairo size 860,330 background rgb 'white' font 'sans,11' enhanced
  }
  set output dir.'/touch.'.kind
  set title 'Panda that presses onto foam, wood and steel: it chatters beyond the limit that was predicted'
  plot dir.'/touch.csv' using 'time [s]':'contact_z [N]' every ::1 with lines ls 1 notitle
  unset output
}

# Draws two releases side by side: gnuplot -e "dir='build/demo'" critical.gp
# dir/critical.txt holds titles, then time (s) and four displacements (mm).

set style line 1 lc rgb '#d95f02' lw 2
set style line 2 lc rgb '#1f5fa8' lw 2
set grid lc rgb '#dddddd'
set border lc rgb '#555555'
set key top right autotitle columnheader
set xrange [0:4]
set yrange [-10:21]
set xlabel 'time, s'

do for [kind in 'svg png'] {
  if (kind eq 'svg') {
    set terminal svg size 860,330 background rgb 'white' font 'sans-serif,13'
  } else {
    set terminal pngcairo size 860,330 background rgb 'white' font 'sans,11'
  }
  set output dir.'/critical.'.kind
  set multiplot layout 1,2 title 'Panda, K = 200 N/m and 20 N m/rad, displaced by 2 cm and let go'
  set title 'home posture'
  set ylabel 'tip displacement along x, mm'
  plot dir.'/critical.txt' using 1:2 with lines ls 1, '' using 1:3 with lines ls 2
  set title 'stretched posture'
  unset ylabel
  plot dir.'/critical.txt' using 1:4 with lines ls 1, '' using 1:5 with lines ls 2
  unset multiplot
  unset output
}

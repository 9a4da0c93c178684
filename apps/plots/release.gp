# Draws three releases, one above the other: gnuplot -e "dir='build/demo'" release.gp
# dir/c1.txt, c2.txt and ratio_damping.txt hold time (s), simulated and predicted displacement (mm).

set style line 1 lc rgb '#1f5fa8' lw 2
set style line 2 lc rgb '#d95f02' lw 2 dt (6, 6)
set grid lc rgb '#dddddd'
set border lc rgb '#555555'
set key top right
set xrange [0:3]
set yrange [-22:22]
set ylabel 'tip displacement along y, mm'

do for [kind in 'svg png'] {
  if (kind eq 'svg') {
    set terminal svg size 860,900 background rgb 'white' font 'sans-serif,13'
  } else {
    set terminal pngcairo size 860,900 background rgb 'white' font 'sans,11'
  }
  set output dir.'/release.'.kind
  set multiplot layout 3,1 title 'Panda, displaced by 2 cm and let go'
  unset xlabel
  set title 'C_1 = diag(5, 3, 5, 1, 1, 1): damping ratios near 0.03'
  plot dir.'/c1.txt' using 1:2 with lines ls 1 title 'simulated', \
       '' using 1:3 with lines ls 2 title 'predicted by the modes'
  set title 'C_2 = diag(22.5, 23.5, 45, 2, 12, 1): damping ratios above 0.2'
  plot dir.'/c2.txt' using 1:2 with lines ls 1 title 'simulated', \
       '' using 1:3 with lines ls 2 title 'predicted by the modes'
  set xlabel 'time, s'
  set title 'C designed at every tick: damping ratio 0.7'
  plot dir.'/ratio_damping.txt' using 1:2 with lines ls 1 title 'simulated', \
       '' using 1:3 with lines ls 2 title 'predicted by the modes'
  unset multiplot
  unset output
}

# Draws the ratios along a way of the tip: gnuplot -e "dir='build/demo'" path.gp
# dir/path.txt holds the way (m), then smallest and largest ratio of three dampings.

set style fill transparent solid 0.35 noborder
set grid lc rgb '#dddddd'
set border lc rgb '#555555'
set key top left
set xlabel 'way of the tip, m'
set ylabel 'damping ratio (smallest to largest of the six modes)'
set yrange [0:*]

do for [kind in 'svg png'] {
  if (kind eq 'svg') {
    set terminal svg size 860,520 background rgb 'white' font 'sans-serif,13'
  } else {
    set terminal pngcairo size 860,520 background rgb 'white' font 'sans,11'
  }
  set output dir.'/path.'.kind
  set title 'Panda on a straight way: what constant damping makes of a ratio of 0.7'
  plot dir.'/path.txt' using 1:2:3 with filledcurves lc rgb '#d95f02' title 'C_C designed at the start, kept', \
       '' using 1:4:5 with filledcurves lc rgb '#7a7a7a' title 'one C_C designed for the whole way', \
       '' using 1:6 with lines lc rgb '#1f5fa8' lw 3 title 'C_C designed at each place'
  unset output
}

# Draws the gain margin of an impedance over the stiffness of its gears: gnuplot -e "dir='build/demo'" elastic.gp

set border lc rgb '#555555'
set logscale xy
set format x '10^{%T}'
set format y '%g'
set xlabel 'stiffness of the gears at the shoulder, N m/rad'
set ylabel 'gain margin'
set xrange [3000:8e5]
set yrange [0.1:60]
set key bottom right
set grid lc rgb '#dddddd'
do for [kind in 'svg png'] {
  if (kind eq 'svg') {
    set terminal svg size 760,420 background rgb 'white' font 'sans-serif,13'
  } else {
    set terminal pngcairo size 760,420 background rgb 'white' font 'sans,11'
  }
  set output dir.'/elastic.'.kind
  plot dir.'/elastic.txt' using 1:4 with lines lw 2 dt 2 lc rgb '#1f5fa8' title 'motor measured, gears damped by 5 %', \
       '' using 1:2 with lines lw 2 lc rgb '#1f5fa8' title 'motor measured, 1 %', \
       '' using 1:5 with lines lw 2 dt 2 lc rgb '#d95f02' title 'link measured, 5 %', \
       '' using 1:3 with lines lw 2 lc rgb '#d95f02' title 'link measured, 1 %', \
       1 with lines lc rgb '#555555' title 'below: unstable'
  unset output
}

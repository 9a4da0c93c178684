# Draws what trends.py wrote, one map above the other: gnuplot -e "dir='build/demo'" trends.gp

set palette defined (-1 '#d95f02', 0 'white', 1 '#1f5fa8')
set border lc rgb '#555555'
unset key
text(x) = abs(x) < 0.005 ? '0.00' : sprintf('%.2f', x)  # without a sign before what rounds to zero
set ylabel 'mode'
set yrange [5.5:-0.5]
set ytics ('1' 0, '2' 1, '3' 2, '4' 3, '5' 4, '6' 5)

do for [kind in 'svg png'] {
  if (kind eq 'svg') {
    set terminal svg size 760,1000 background rgb 'white' font 'sans-serif,13'
  } else {
    set terminal pngcairo size 760,1000 background rgb 'white' font 'sans,11'
  }
  set output dir.'/trends.'.kind
  set multiplot layout 3,1 title 'Panda with a damping ratio of 0.7: what single entries change, percent'
  set xtics ('x' 0, 'y' 1, 'z' 2, 'rx' 3, 'ry' 4, 'rz' 5)
  set xrange [-0.5:5.5]
  set cbrange [-1.5:1.5]
  set cblabel 'ratio, %'
  set title 'damping ratio, by 1 % of a diagonal entry of C_C'
  plot dir.'/trends_damping.txt' matrix with image, \
       '' matrix using 1:2:(text($3)) with labels
  set cbrange [-0.5:0.5]
  set cblabel 'frequency, %'
  set title 'natural frequency, by 1 % of a diagonal entry of K_C'
  plot dir.'/trends_stiffness.txt' matrix with image, \
       '' matrix using 1:2:(text($3)) with labels
  set xtics ('q1' 0, 'q2' 1, 'q3' 2, 'q4' 3, 'q5' 4, 'q6' 5, 'q7' 6, 'tip' 7)
  set xrange [-0.5:7.5]
  set cbrange [-8:8]
  set title 'natural frequency, by 0.001 kg m^2 more in a joint, or 0.1 kg more at the tip'
  plot dir.'/trends_inertia.txt' matrix with image, \
       '' matrix using 1:2:(text($3)) with labels
  unset multiplot
  unset output
}

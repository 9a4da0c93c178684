# Draws what report.py wrote: gnuplot -e "dir='build/bench'" benchmarks/plots.gp

set style line 1 lc rgb '#1f5fa8' lw 3 pt 7 ps 0.6
set style line 2 lc rgb '#d95f02' lw 3 pt 5 ps 0.6
set style line 3 lc rgb '#7a7a7a' lw 3 pt 9 ps 0.6
set style line 11 lc rgb '#9fbfe0' lw 1
set style line 12 lc rgb '#f3c39b' lw 1
set style line 13 lc rgb '#cccccc' lw 1
set grid lc rgb '#dddddd'
set border lc rgb '#555555'
set logscale xy
set format xy '10^{%T}'

do for [kind in 'svg png'] {
  if (kind eq 'svg') {
    set terminal svg size 1200,460 background rgb 'white' font 'sans-serif,12'
  } else {
    set terminal pngcairo size 1200,460 background rgb 'white' font 'sans,10'
  }
  set output dir.'/simulation.'.kind
  set key top right
  set multiplot layout 1,3 title 'A second of a released Panda: error against time; thin: each method, thick: the best of a library'
  set xlabel 'CPU time, us'
  set ylabel 'error of the joint angles, rad'
  set xrange [20:1e5]
  set yrange [1e-13:0.1]
  set key top right
  do for [gains in 'soft ordinary stiff'] {
    set title gains.(gains eq 'soft' ? ', 1e2 N/m' : gains eq 'ordinary' ? ', 1e3 N/m' : ', 1e5 N/m')
    file(whose, end) = dir.'/simulation_'.gains.'_'.whose.end.'.dat'
    plot file('mujoco', '') using 1:2 with lines ls 13 notitle, \
         file('odeint', '') using 1:2 with lines ls 12 notitle, \
         file('ours', '') using 1:2 with lines ls 11 notitle, \
         file('mujoco', '_front') using 1:2 with linespoints ls 3 title 'MuJoCo', \
         file('odeint', '_front') using 1:2 with linespoints ls 2 title 'Boost.Odeint', \
         file('ours', '_front') using 1:2 with linespoints ls 1 title 'Dashpot'
  }
  unset multiplot
  unset output

  if (kind eq 'svg') {
    set terminal svg size 1200,800 background rgb 'white' font 'sans-serif,12'
  } else {
    set terminal pngcairo size 1200,800 background rgb 'white' font 'sans,10'
  }
  set output dir.'/spectrum.'.kind
  set multiplot layout 2,3 title 'Spectra of 2 to 20 modes: largest error of an eigenvalue against time'
  set ylabel 'relative error'
  set xrange [0.2:1e4]
  set yrange [1e-17:20]
  do for [scaling in 'well badly'] {
    do for [family in 'light critical heavy'] {
      if (scaling eq 'well') { set key top right } else { unset key }
      set title family.' damping, '.scaling.' scaled'
      name = dir.'/spectrum_'.family.'_'.scaling.'_'
      plot name.'dggev.dat' using 1:2 with points lc rgb '#7a7a7a' pt 9 title 'LAPACK dggev', \
           name.'dgeev.dat' using 1:2 with points lc rgb '#b8860b' pt 11 title 'LAPACK dgeev', \
           name.'eigen.dat' using 1:2 with points lc rgb '#d95f02' pt 5 title 'Eigen', \
           name.'ours_direct.dat' using 1:2 with points lc rgb '#1f5fa8' pt 7 title 'Dashpot, direct', \
           name.'ours_tracked.dat' using 1:2 with points lc rgb '#1f5fa8' pt 6 title 'tracked', \
           name.'ours_reused.dat' using 1:2 with points lc rgb '#1f5fa8' pt 1 title 'reused'
    }
  }
  unset multiplot
  unset output
}

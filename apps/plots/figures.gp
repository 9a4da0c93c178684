# Draws what figures.py wrote, one figure below the other: gnuplot -e "dir='build/demo'" figures.gp

set border lc rgb '#555555'
set grid lc rgb '#dddddd'
set key outside right samplen 2
colours = "#0072b2 #d55e00 #009e73 #cc79a7 #e69f00 #56b4e9 #000000"

do for [kind in 'svg png'] {
  if (kind eq 'svg') {
    set terminal svg size 860,1080 background rgb 'white' font 'sans-serif,13'
  } else {
    set terminal pngcairo size 860,1080 background rgb 'white' font 'sans,11'
  }
  set output dir.'/figures.'.kind
  set multiplot layout 3,1
  do for [figure in '3 4 5'] {
    n = figure eq '5' ? 7 : 3
    scale = figure eq '5' ? 1 : 1e3
    set xlabel 't, s'
    set ylabel figure eq '5' ? 'q, rad' : 'q, mm'
    set title figure eq '3' ? 'Fig. 3: three masses, the second released 3 cm off' : \
              figure eq '4' ? 'Fig. 4: three masses, the first struck with 1 N s' : \
                              'Fig. 5: a Baxter arm released, five springs on seven joints'
    plot for [i=1:n] dir.'/figure'.figure.'.txt' using 1:(scale * column(i + 1)) with lines lw 2 \
           lc rgb word(colours, i) title sprintf('q%d', i), \
         for [i=1:n] '' using 1:(scale * column(i + 1 + n)) with lines dt 2 lw 1 lc rgb word(colours, i) \
           title i == 1 ? 'zero modes' : ''
  }
  unset multiplot
  unset output
}

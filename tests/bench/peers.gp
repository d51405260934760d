# gnuplot -e "columns='FILE'; out='FILE.png'" peers.gp: seconds of each tool on each mesh.
set terminal pngcairo size 900,400 font "sans,10"
set output out
set style data histograms
set style histogram clustered gap 1
set style fill solid noborder
set boxwidth 0.9
set logscale y
set format y "%g"
set ylabel "seconds on one core"
set grid ytics lt 1 lw 0.5 lc rgb "#cccccc"
set key top left Left reverse samplen 1
set bmargin 3.5
plot columns using 2:xtic(1) title "planish" lc rgb "#1b6ca8", \
     '' using 3 title "Blender 3.4 ABF" lc rgb "#edae49", \
     '' using 4 title "CGAL 5.5 LSCM" lc rgb "#66a182"

# gnuplot -e "columns='FILE'; out='FILE.png'" paper.gp: what each step away from the paper buys.
set terminal pngcairo size 1100,470 font "sans,10"
set output out
set multiplot layout 1,2 margins 0.07,0.83,0.2,0.92 spacing 0.09,0
set style line 1 lc rgb "#1b6ca8" lw 2 pt 7
set style line 2 lc rgb "#d1495b" lw 2 pt 7
set style line 3 lc rgb "#66a182" lw 2 pt 7
set style line 4 lc rgb "#edae49" lw 2 pt 7
set style line 5 lc rgb "#8d6a9f" lw 2 pt 7
set style line 6 lc rgb "#444444" lw 2 pt 7
set style line 7 lc rgb "#3fb6c6" lw 2 pt 7
set logscale y
set format y "10^{%L}"
set grid ytics lt 1 lw 0.5 lc rgb "#cccccc"
set xtics ("full,\nnone" 0, "full,\nJacobi" 1, "reduced,\nnone" 2, "reduced,\nJacobi" 3, "reduced,\nmultigrid" 4, "and\nforcing" 5)
set xrange [-0.3:5.3]
set datafile columnheaders
stats columns nooutput
blocks = STATS_blocks
half = blocks / 2
set title "linear iterations of the whole solve (open: given up)"
unset key
plot for [i=0:half-1] columns index i using 1:3 with lines ls (i % 7 + 1) dt 2 lw 1, \
     for [i=half:blocks-1] columns index i using 1:3 with linespoints ls ((i - half) % 7 + 1), \
     for [i=half:blocks-1] columns index i using 1:($4 == 1 ? $3 : NaN) with points pt 7 ps 0.6 lc rgb "white"
set title "CPU seconds (open: given up)"
set key at graph 1.03,1 left top Left reverse samplen 1.5 noenhanced
plot for [i=0:half-1] columns index i using 1:2 with lines ls (i % 7 + 1) dt 2 lw 1 notitle, \
     for [i=half:blocks-1] columns index i using 1:2 with linespoints ls ((i - half) % 7 + 1) title columnheader(1), \
     for [i=half:blocks-1] columns index i using 1:($4 == 1 ? $2 : NaN) with points pt 7 ps 0.6 lc rgb "white" notitle, \
     NaN with lines lc rgb "black" lw 2 title "Uzawa", NaN with lines lc rgb "black" dt 2 title "MINRES"
unset multiplot

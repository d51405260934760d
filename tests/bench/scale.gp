# gnuplot -e "columns='FILE'; out='FILE.png'" scale.gp: time and memory over the number of triangles.
set terminal pngcairo size 1100,400 font "sans,10"
set output out
set multiplot layout 1,3 margins 0.06,0.98,0.14,0.9 spacing 0.07,0
set datafile columnheaders
stats columns nooutput
last = STATS_blocks - 1
set style line 1 lc rgb "#1b6ca8" lw 2 pt 7
set style line 2 lc rgb "#d1495b" lw 2 pt 7
set style line 3 lc rgb "#66a182" lw 2 pt 5
set style line 4 lc rgb "#edae49" lw 2 pt 5
set logscale x
set xlabel "triangles"
set format x "10^{%L}"
set grid lt 1 lw 0.5 lc rgb "#cccccc"
set key left top Left reverse samplen 1.5 noenhanced
set logscale y
set format y "10^{%L}"
set title "seconds"
plot for [i=0:last] columns index i using 1:2 with linespoints ls (i % 4 + 1) title columnheader(1)
unset logscale y
set format y "%g"
set yrange [0:*]
set offsets graph 0, 0, 0.08, 0
unset key
set title "CPU microseconds a triangle"
plot for [i=0:last] columns index i using 1:3 with linespoints ls (i % 4 + 1)
set title "peak bytes a triangle"
plot for [i=0:last] columns index i using 1:4 with linespoints ls (i % 4 + 1)
unset multiplot

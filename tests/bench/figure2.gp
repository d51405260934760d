# gnuplot -e "spy='PREFIX'; rows=N; left='N'; right='N'; out='FILE.png'" figure2.gp: nonzeros of the matrix of eq. 5.
set terminal pngcairo size 900,490 font "sans,10"
set output out
set multiplot layout 1,2 margins 0.02,0.98,0.03,0.9 spacing 0.04,0
set xrange [0:rows]
set yrange [rows:0]
set size square
unset key
unset tics
set title "wheel condition as a product: ".left." nonzeros"
plot spy.".product" using 2:1 with dots lc rgb "#1b6ca8"
set title "as a logarithm (eq. 6): ".right." nonzeros"
plot spy.".log" using 2:1 with dots lc rgb "#1b6ca8"
unset multiplot

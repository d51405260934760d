# gnuplot -e "columns='FILES'; out='FILE.png'" atlas.gp: seconds, charts and packing efficiency of each tool on each mesh.
set terminal pngcairo size 1200,1200 font "sans,10"
set output out
set style data histograms
set style histogram clustered gap 1
set style fill solid noborder
set boxwidth 0.9
set grid ytics lt 1 lw 0.5 lc rgb "#cccccc"
set key outside top right horizontal samplen 1
set xtics noenhanced rotate by 45 right font ",8"
set lmargin 10
set datafile separator tab
tools = int(system("head -1 '".columns.".charts' | tr -cd '\t' | wc -c"))
colour(i) = word("#1b6ca8 #edae49 #66a182", i - 1)
set multiplot layout 3,1
set logscale y
set format y "%g"
set ylabel "seconds, one core"
plot for [i=2:tools + 1] columns.".map_seconds" using i:xtic(1) title columnheader(i) lc rgb colour(i)
set key off
set yrange [0.5:*]
set ylabel "charts"
plot for [i=2:tools + 1] columns.".charts" using i:xtic(1) title columnheader(i) lc rgb colour(i)
unset logscale y
set yrange [0:1]
set ylabel "packing efficiency"
plot for [i=2:tools + 1] columns.".packing_efficiency" using i:xtic(1) title columnheader(i) lc rgb colour(i)
unset multiplot

# gnuplot -e "columns='FILE'; out='FILE.png'" peers.gp: CPU seconds of each tool on each mesh.
set terminal pngcairo size 900,400 font "sans,10"
set output out
set style data histograms
set style histogram clustered gap 1
set style fill solid noborder
set boxwidth 0.9
set logscale y
set format y "%g"
set ylabel "CPU seconds, one core"
set grid ytics lt 1 lw 0.5 lc rgb "#cccccc"
set key top left Left reverse samplen 1
set xtics noenhanced
set bmargin 3.5
set datafile separator tab
tools = int(system("head -1 '".columns."' | tr -cd '\t' | wc -c"))
plot for [i=2:tools + 1] columns using i:xtic(1) title columnheader(i) lc rgb word("#1b6ca8 #edae49 #66a182", i - 1)

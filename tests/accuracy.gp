# Error against steps, from curve.csv of tests/accuracy.c: gnuplot -e "folder='build/accuracy'" tests/accuracy.gp
set datafile separator ','
set logscale xy
set grid
set key top right
set xrange [3:700]
set yrange [1e-6:1]
set xlabel 'steps along the ray (march: as many again towards the sun)'
set ylabel 'relative RMS error of spectral radiance'
set title 'Single scattering against double-precision quadrature, software device'
set format y '10^{%L}'
curve(method, class, column) = sprintf("< awk -F, '$1==\"%s\" && $2==\"%s\" {print $3 \",\" $%d}' %s/curve.csv", \
	method, class, column, folder)
do for [kind in "svg png"] {
	if (kind eq "svg") { set terminal svg size 900,600 font 'sans,12' }
	if (kind eq "png") { set terminal pngcairo size 900,600 font 'sans,11' }
	set output sprintf('%s/accuracy.%s', folder, kind)
	plot 0.01 with lines dt 3 lc rgb 'grey' title '1 %', \
		0.001 with lines dt 4 lc rgb 'grey' title '0.1 %', \
		curve('depth_table', 'sun_2_or_more', 4) with linespoints pt 7 lc 1 title 'depth\_table, sun at 2° or more', \
		curve('depth_table', 'sun_2_or_more', 5) with linespoints pt 6 dt 2 lc 1 title 'its worst cell', \
		curve('depth_table', 'sun_below_2', 4) with linespoints pt 5 lc 3 title 'depth\_table, sun at 0 and -3°', \
		curve('march', 'sun_2_or_more', 4) with linespoints pt 7 lc 2 title 'march, sun at 2° or more', \
		curve('march', 'sun_2_or_more', 5) with linespoints pt 6 dt 2 lc 2 title 'its worst cell', \
		curve('march', 'sun_below_2', 4) with linespoints pt 5 lc 4 title 'march, sun at 0 and -3°'
}

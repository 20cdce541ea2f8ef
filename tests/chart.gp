# Error against milliseconds and maps of error, from what tests/chart.c wrote:
# gnuplot -e "folder='build/chart'" tests/chart.gp
classes = system(sprintf("cat '%s/classes.txt'", folder))
device = system(sprintf("cat '%s/device.txt'", folder))
set key outside right top noenhanced
set grid
do for [class in classes] {
	data = sprintf('%s/plot-%s.txt', folder, class)
	last = int(system(sprintf("grep -c '^\"' '%s'", data))) - 1
	set logscale xy
	set xlabel 'device time of a 1280x720 frame with its own tables, ms'
	set ylabel 'relative RMS error of luminance'
	set format y '10^{%L}'
	set title sprintf("%s: error against cost on %s", class, device) noenhanced
	do for [kind in "svg png"] {
		if (kind eq "svg") { set terminal svg size 900,560 font 'sans,12' }
		if (kind eq "png") { set terminal pngcairo size 900,560 font 'sans,10' }
		set output sprintf('%s/chart-%s.%s', folder, class, kind)
		plot 0.02 with lines dt 3 lc rgb 'grey' title '2 %', \
			for [i=0:last-1] data index i using 1:2 with linespoints pt 7 ps 0.9 lc i+1 title columnheader(1), \
			data index last using 1:2 with lines lw 3 lc rgb '#80000000' title columnheader(1)
	}
}
# The one for the README: four classes at once.
set terminal pngcairo size 1200,860 font 'sans,10'
set output sprintf('%s/chart.png', folder)
set multiplot layout 2,2 title sprintf("Error against cost, 1280x720 frames on %s", device) noenhanced
set key inside top right noenhanced font ',8' samplen 1
set xlabel 'device time, ms'
set ylabel 'relative RMS error of luminance'
set yrange [1e-3:10]
do for [class in "day low twilight space"] {
	data = sprintf('%s/plot-%s.txt', folder, class)
	if (strstrt(classes, class) == 0) { continue }
	last = int(system(sprintf("grep -c '^\"' '%s'", data))) - 1
	set title class noenhanced
	plot 0.02 with lines dt 3 lc rgb 'grey' notitle, \
		for [i=0:last-1] data index i using 1:2 with linespoints pt 7 ps 0.8 lc i+1 title columnheader(1), \
		data index last using 1:2 with lines lw 3 lc rgb '#80000000' title columnheader(1)
}
unset multiplot
set autoscale
unset logscale
unset key
unset grid
set format '%g'
set xlabel ''
set ylabel ''
unset xtics
unset ytics
set terminal pngcairo size 640,360 font 'sans,10'
set palette defined (-0.3 '#2040c0', -0.02 '#a0c0ff', 0 'white', 0.02 '#ffc0a0', 0.3 '#c02020')
set cbrange [-0.3:0.3]
set cblabel 'relative error of luminance'
set size ratio -1
do for [file in system(sprintf("ls %s/map-*.txt", folder))] {
	set output file[1:strlen(file)-4] . '.png'
	set title system(sprintf("basename '%s' .txt", file)) noenhanced
	plot file matrix using 1:2:3 with image
}

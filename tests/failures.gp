# Where a method fails, from what tests/failures.c wrote: gnuplot -e "folder='build/failures'" tests/failures.gp
set terminal pngcairo size 760,520 font 'sans,10'
set palette maxcolors 10 defined (0 '#d8f0d8', 1 '#ffe080', 2 '#ff9040', 3 '#4060ff', 4 '#c00000', \
	5 '#eeeeee', 6 '#d8d0b0', 7 '#d0b8a8', 8 '#a8b0d0', 9 '#b09090')
set cbrange [-0.5:9.5]
set cbtics ('sound' 0, 'jumps' 1, 'wrong' 2, 'negative' 3, 'not finite' 4, 'outside: sound' 5, 'outside: jumps' 6, \
	'outside: wrong' 7, 'outside: negative' 8, 'outside: not finite' 9)
set xlabel 'sun elevation, degrees'
set ylabel 'camera altitude, m'
unset key
set rmargin 22
do for [file in system(sprintf("ls %s/failure-*.txt", folder))] {
	set output file[1:strlen(file)-4] . '.png'
	set title system(sprintf("basename '%s' .txt", file)) noenhanced
	plot file using 1:2:3 with image, '' using 1:2:(''):xtic(sprintf('%g', $4)):ytic(sprintf('%g', $5)) with labels
}

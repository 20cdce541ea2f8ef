#ifndef WELKIN_SERVER_DEFLATE_H
#define WELKIN_SERVER_DEFLATE_H

#include <stddef.h>

/*
 * A DEFLATE encoder (RFC 1951) for one kind of data: residuals of filtered image rows, where
 * dither leaves nothing to match but runs of zeros. It codes literals and runs of one byte with a
 * Huffman code made for the block, so it is several times faster than a general compressor at about
 * the same size (tests/bench_encode.c). Blocks are independent and end on a byte, so an image's
 * blocks are made in parallel and simply follow one another.
 */

/* Room that welkin_deflate_block may need for n bytes. */
size_t welkin_deflate_bound(size_t n);

/* Appends data[0, n) as non-final blocks to out, which must be byte-aligned in the stream, and
 * returns the bytes written, at most welkin_deflate_bound(n). The same input gives the same output. */
size_t welkin_deflate_block(const unsigned char *data, size_t n, unsigned char *out);

#endif

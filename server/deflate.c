#include "server/deflate.h"

#include <assert.h>
#include <endian.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum {
	END_OF_BLOCK = 256,
	LITERALS = 286,        /* literals, end of block and the length codes */
	LITERAL_MAX_BITS = 12, /* so that four literals fit in the bit buffer between two flushes */
	LENGTHS = 19,          /* the code that the code lengths are sent in */
	LENGTH_MAX_BITS = 7,
	GROUP = 8,    /* bytes looked at together for a run of zeros */
	MIN_RUN = 16, /* shorter runs cost less as literals */
	MAX_MATCH = 258,
	BLOCK = 1 << 17, /* long enough to pay for its code, short enough to follow the picture */
	MAX_STORED = 65535,
};

/* ---- bits ---- */

struct bits {
	unsigned char *next;
	uint64_t buffer;
	int n; /* bits in the buffer; less than 8 after a flush */
};

static inline void put(struct bits *b, uint64_t value, int n)
{
	b->buffer |= value << b->n;
	b->n += n;
}

/* Writes the whole bytes; what it writes beyond them is overwritten later, hence the slack in the bound. */
static inline void flush(struct bits *b)
{
	const uint64_t word = htole64(b->buffer);
	memcpy(b->next, &word, sizeof word);
	b->next += b->n >> 3;
	b->buffer >>= b->n & ~7;
	b->n &= 7;
}

/* ---- Huffman codes ---- */

struct code {
	uint16_t bits[LITERALS]; /* as they go into the stream: first bit lowest */
	uint8_t length[LITERALS];
};

struct leaf {
	uint32_t count;
	int symbol, depth;
};

static int by_count(const void *a, const void *b)
{
	const struct leaf *x = a, *y = b;
	if (x->count != y->count)
		return x->count < y->count ? -1 : 1;
	return x->symbol - y->symbol;
}

/* Depths of the Huffman tree over n ≥ 2 leaves in ascending order of count. Two queues: the
 * lightest node is always the next leaf or the oldest node made and not yet taken. */
static void tree_depths(struct leaf *leaf, int n)
{
	uint64_t weight[LITERALS];
	int leaf_parent[LITERALS] = { 0 }, node_parent[LITERALS] = { 0 }, level[LITERALS];
	int leaves = 0, nodes = 0;
	assert(n >= 2);
	for (int made = 0; made < n - 1; made++) {
		weight[made] = 0;
		for (int side = 0; side < 2; side++) {
			if (leaves < n && (nodes == made || leaf[leaves].count <= weight[nodes])) {
				weight[made] += leaf[leaves].count;
				leaf_parent[leaves++] = made;
			} else {
				weight[made] += weight[nodes];
				node_parent[nodes++] = made;
			}
		}
	}
	level[n - 2] = 0;
	for (int i = n - 3; i >= 0; i--)
		level[i] = level[node_parent[i]] + 1;
	for (int i = 0; i < n; i++)
		leaf[i].depth = level[leaf_parent[i]] + 1;
}

/* Cuts the depths at max_bits and mends them until the code is exactly complete (Kraft's sum is 1),
 * as decoders demand: the rarest leaves sink to make room, then the most frequent ones rise into what is left. */
static void limit_depths(struct leaf *leaf, int n, int max_bits)
{
	int room = 1 << max_bits; /* in units of the longest code's share */
	for (int i = 0; i < n; i++) {
		if (leaf[i].depth > max_bits)
			leaf[i].depth = max_bits;
		room -= 1 << (max_bits - leaf[i].depth);
	}
	for (int i = 0; room < 0; i = i + 1 < n ? i + 1 : 0) {
		while (room < 0 && leaf[i].depth < max_bits)
			room += 1 << (max_bits - ++leaf[i].depth);
	}
	for (int i = n - 1; room > 0; i = i > 0 ? i - 1 : n - 1) {
		while (room > 0 && leaf[i].depth > 1 && 1 << (max_bits - leaf[i].depth) <= room)
			room -= 1 << (max_bits - leaf[i].depth--);
	}
}

static void assign_bits(struct code *code, int n_symbols)
{
	int per_length[16] = { 0 };
	uint32_t next[16] = { 0 };
	for (int i = 0; i < n_symbols; i++)
		per_length[code->length[i]]++;
	per_length[0] = 0;
	for (int length = 1; length < 16; length++)
		next[length] = (next[length - 1] + (uint32_t)per_length[length - 1]) << 1;
	for (int i = 0; i < n_symbols; i++) {
		uint32_t value = code->length[i] ? next[code->length[i]]++ : 0, reversed = 0;
		for (int bit = 0; bit < code->length[i]; bit++, value >>= 1)
			reversed = reversed << 1 | (value & 1);
		code->bits[i] = (uint16_t)reversed;
	}
}

/* A complete code for the symbols that occur. At least two get a code, since decoders refuse a code of one. */
static void make_code(const uint32_t *count, int n_symbols, int max_bits, struct code *code)
{
	struct leaf leaf[LITERALS];
	int n = 0;
	memset(code, 0, sizeof *code);
	for (int i = 0; i < n_symbols; i++) {
		if (count[i])
			leaf[n++] = (struct leaf){ count[i], i, 0 };
	}
	for (int i = 0; n < 2; i++) {
		if (!count[i])
			leaf[n++] = (struct leaf){ 0, i, 0 };
	}
	qsort(leaf, (size_t)n, sizeof *leaf, by_count);
	tree_depths(leaf, n);
	limit_depths(leaf, n, max_bits);
	for (int i = 0; i < n; i++)
		code->length[leaf[i].symbol] = (uint8_t)leaf[i].depth;
	assign_bits(code, n_symbols);
}

/* ---- the block's head: the code lengths, run-length coded and themselves Huffman coded ---- */

struct length_token {
	uint8_t symbol, extra_bits, extra;
};

static int tokenize_lengths(const uint8_t *length, int n, struct length_token *token)
{
	int n_tokens = 0;
	for (int i = 0, run; i < n; i += run) {
		for (run = 1; i + run < n && length[i + run] == length[i];)
			run++;
		int left = run;
		if (length[i] == 0) {
			for (int take; left >= 3; left -= take) {
				take = left < 138 ? left : 138;
				token[n_tokens++] = take < 11 ? (struct length_token){ 17, 3, (uint8_t)(take - 3) }
							      : (struct length_token){ 18, 7, (uint8_t)(take - 11) };
			}
		} else {
			token[n_tokens++] = (struct length_token){ length[i], 0, 0 };
			left--;
			for (int take; left >= 3; left -= take) {
				take = left < 6 ? left : 6;
				token[n_tokens++] = (struct length_token){ 16, 2, (uint8_t)(take - 3) };
			}
		}
		while (left-- > 0)
			token[n_tokens++] = (struct length_token){ length[i], 0, 0 };
	}
	return n_tokens;
}

static void put_head(struct bits *b, const struct code *code)
{
	static const uint8_t order[LENGTHS] = { 16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15 };
	uint8_t length[LITERALS + 1];
	struct length_token token[LITERALS + 1];
	uint32_t count[LENGTHS] = { 0 };
	struct code lengths;
	memcpy(length, code->length, LITERALS);
	length[LITERALS] = 1; /* the only distance, 1 */
	const int n_tokens = tokenize_lengths(length, LITERALS + 1, token);
	for (int i = 0; i < n_tokens; i++)
		count[token[i].symbol]++;
	make_code(count, LENGTHS, LENGTH_MAX_BITS, &lengths);

	put(b, 0, 1); /* not the last block */
	put(b, 2, 2); /* with a code of its own */
	put(b, LITERALS - 257, 5);
	put(b, 0, 5);
	put(b, LENGTHS - 4, 4);
	flush(b);
	for (int i = 0; i < LENGTHS; i++) {
		put(b, lengths.length[order[i]], 3);
		flush(b);
	}
	for (int i = 0; i < n_tokens; i++) {
		put(b, lengths.bits[token[i].symbol], lengths.length[token[i].symbol]);
		put(b, token[i].extra, token[i].extra_bits);
		flush(b);
	}
}

/* ---- tokens: the same walk over the data counts them and writes them ---- */

static inline bool zero_group(const unsigned char *data)
{
	uint64_t word;
	memcpy(&word, data, sizeof word);
	return word == 0;
}

/* Length of the run of zero groups at data[i], in bytes, or 0 when it is shorter than MIN_RUN. */
static inline size_t zero_run(const unsigned char *data, size_t i, size_t n)
{
	if (!zero_group(data + i))
		return 0;
	size_t end = i + GROUP;
	while (end + GROUP <= n && zero_group(data + end))
		end += GROUP;
	return end - i >= MIN_RUN ? end - i : 0;
}

/* How much of a run the next match takes: never so much that fewer than 3 bytes are left. */
static inline int match_length(size_t left)
{
	if (left <= MAX_MATCH)
		return (int)left;
	return left - MAX_MATCH < 3 ? MAX_MATCH - 3 : MAX_MATCH;
}

/* RFC 1951, 3.2.5: the length code and its extra bits. */
static void length_code(int length, int *symbol, int *extra, int *extra_bits)
{
	*extra = *extra_bits = 0;
	if (length == MAX_MATCH) {
		*symbol = 285;
	} else if (length < 11) {
		*symbol = 254 + length;
	} else {
		const int x = length - 3, top = 31 - __builtin_clz((unsigned)x);
		*extra_bits = top - 2;
		*symbol = 257 + 4 * (top - 1) + (x >> *extra_bits & 3);
		*extra = x & ((1 << *extra_bits) - 1);
	}
}

static void count_symbols(const unsigned char *data, size_t n, uint32_t count[LITERALS])
{
	uint32_t part[4][256] = { 0 }; /* four, since counting equal neighbours in one array waits for memory */
	size_t i = 0;
	memset(count, 0, LITERALS * sizeof *count);
	while (i + GROUP <= n) {
		const size_t run = zero_run(data, i, n);
		if (run) {
			count[0]++;
			for (size_t left = run - 1; left;) {
				int length = match_length(left), symbol, extra, extra_bits;
				length_code(length, &symbol, &extra, &extra_bits);
				count[symbol]++;
				left -= (size_t)length;
			}
			i += run;
			continue;
		}
		for (int k = 0; k < GROUP; k++)
			part[k & 3][data[i + (size_t)k]]++;
		i += GROUP;
	}
	for (; i < n; i++)
		count[data[i]]++;
	for (int s = 0; s < 256; s++)
		count[s] += part[0][s] + part[1][s] + part[2][s] + part[3][s];
	count[END_OF_BLOCK] = 1;
}

static void put_run(struct bits *b, const struct code *code, size_t run)
{
	put(b, code->bits[0], code->length[0]);
	for (size_t left = run - 1; left;) {
		int length = match_length(left), symbol, extra, extra_bits;
		length_code(length, &symbol, &extra, &extra_bits);
		put(b, code->bits[symbol], code->length[symbol]);
		put(b, (uint64_t)extra, extra_bits);
		put(b, 0, 1); /* distance 1 */
		flush(b);
		left -= (size_t)length;
	}
}

static void put_data(struct bits *b, const struct code *code, const unsigned char *data, size_t n)
{
	uint32_t packed[256]; /* bits << 8 | length: one load for each literal */
	size_t i = 0;
	for (int s = 0; s < 256; s++)
		packed[s] = (uint32_t)code->bits[s] << 8 | code->length[s];
	while (i + GROUP <= n) {
		const size_t run = zero_run(data, i, n);
		if (run) {
			put_run(b, code, run);
			i += run;
			continue;
		}
		for (int half = 0; half < 2; half++, i += 4) {
			for (int k = 0; k < 4; k++) {
				const uint32_t p = packed[data[i + (size_t)k]];
				put(b, p >> 8, (int)(p & 0xff));
			}
			flush(b);
		}
	}
	for (; i < n; i++) {
		put(b, code->bits[data[i]], code->length[data[i]]);
		flush(b);
	}
	put(b, code->bits[END_OF_BLOCK], code->length[END_OF_BLOCK]);
	flush(b);
}

/* ---- blocks ---- */

/* Ends on a byte: an empty stored block, as zlib's Z_SYNC_FLUSH writes. */
static unsigned char *align(struct bits *b)
{
	put(b, 0, 3);
	b->n = (b->n + 7) & ~7;
	flush(b);
	memcpy(b->next, "\0\0\xff\xff", 4);
	return b->next + 4;
}

static unsigned char *put_stored(unsigned char *out, const unsigned char *data, size_t n)
{
	while (n) {
		const uint16_t take = n < MAX_STORED ? (uint16_t)n : MAX_STORED, le = htole16(take),
			       inverse = (uint16_t)~le;
		*out++ = 0;
		memcpy(out, &le, 2);
		memcpy(out + 2, &inverse, 2);
		memcpy(out + 4, data, take);
		out += 4 + take;
		data += take;
		n -= take;
	}
	return out;
}

static unsigned char *put_block(unsigned char *out, const unsigned char *data, size_t n)
{
	struct bits b = { .next = out };
	uint32_t count[LITERALS];
	struct code code;
	count_symbols(data, n, count);
	make_code(count, LITERALS, LITERAL_MAX_BITS, &code);
	put_head(&b, &code);
	put_data(&b, &code, data, n);
	unsigned char *end = align(&b);
	const size_t stored = n + 5 * (n / MAX_STORED + 1);
	return (size_t)(end - out) <= stored ? end : put_stored(out, data, n);
}

size_t welkin_deflate_bound(size_t n)
{
	/* A literal takes at most 12 bits, and a code made for the data never more than 9 on average;
	 * 512 for the head, the end, and what flush() writes ahead, in each block. */
	return n + n / 2 + 512 * (n / BLOCK + 1);
}

size_t welkin_deflate_block(const unsigned char *data, size_t n, unsigned char *out)
{
	unsigned char *end = out;
	for (size_t i = 0; i < n; i += BLOCK)
		end = put_block(end, data + i, n - i < BLOCK ? n - i : BLOCK);
	assert((size_t)(end - out) <= welkin_deflate_bound(n));
	return (size_t)(end - out);
}

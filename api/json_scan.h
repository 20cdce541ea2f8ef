#ifndef WELKIN_API_JSON_SCAN_H
#define WELKIN_API_JSON_SCAN_H

#include <cJSON.h>

#include <stdbool.h>
#include <stddef.h>

enum { JSON_MAX_DEPTH = 32 };

/*
 * RFC 8259 text into a cJSON tree (the caller's, cJSON_Delete), or NULL with one sentence of
 * reason. cJSON 1.7.15 alone takes too much: a byte order mark, bytes that are not UTF-8, control
 * characters in and between tokens, numbers such as 007 or of more than 63 characters (which it
 * cuts), \u0000 (which ends a string early), a depth of 1000, anything after the end. A scan over
 * the tokens refuses these first; cJSON then sees to their order. Numbers may still be infinite
 * (1e999) and keys may repeat: the reader of the tree looks for that.
 */
cJSON *json_read(const char *bytes, size_t length, char reason[160]);

#endif

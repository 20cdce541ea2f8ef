#include "server/version.h"

#if __has_include("revision.h")
#include "revision.h"
#endif
#ifndef WELKIN_REVISION
#define WELKIN_REVISION "unknown"
#endif

const char build_version[] = WELKIN_VERSION;
const char build_revision[] = WELKIN_REVISION;
const char build_name[] = "welkin " WELKIN_VERSION " (" WELKIN_REVISION ")";

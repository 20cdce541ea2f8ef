#include "gpu/method.h"
const struct method method_preetham = { .name = "preetham" };

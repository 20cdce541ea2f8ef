#include "gpu/method.h"
const struct method method_march = { .name = "march" };

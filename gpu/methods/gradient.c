#include "gpu/method.h"
const struct method method_gradient = { .name = "gradient" };

#include "gpu/method.h"
const struct method method_depth_table = { .name = "depth_table" };

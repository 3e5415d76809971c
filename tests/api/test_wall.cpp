// The C test as C++.
#include "test_wall.c"

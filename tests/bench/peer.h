/* What a shared library has to offer for bench_closest to measure it beside the others: write these functions around any
 * search for closest points, and name the file in the environment variable CLOSEST_PEER. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

const char* peer_name(void);
/* points: x, y and z of each; corners: three points of each triangle. Both live longer than the peer. */
void* peer_build(const double* points, size_t point_count, const uint32_t* corners, size_t triangle_count);
/* The distance; `offset` is from x to the closest point. It is known to be nearer than `radius`. */
double peer_closest(void* peer, const double x[3], double radius, double offset[3]);
void peer_destroy(void* peer);

#ifdef __cplusplus
}
#endif

// A custom profile function f(d, t) in newtons, immutable. It is the fs_curve of the C contract itself.
#pragma once

#include <string>
#include <vector>

#include <forceserver/object.h>

#include "base/counted.h"

namespace fs {

// An intensity (N, >= 0) and its slope in d (N/m).
struct Intensity {
  double force = 0, slope = 0;
};

}  // namespace fs

struct fs_curve : fs::Counted<fs_curve> {
  virtual ~fs_curve() = default;

  // Makes all that `reader` needs to evaluate this curve without allocating. Any thread, off the tick; idempotent.
  virtual void prepare(unsigned reader) const = 0;

  // [rt] d in m, >= 0; t in s. One thread at a time for each reader, which must have been prepared.
  virtual fs::Intensity evaluate(unsigned reader, double d, double t) const noexcept = 0;

  virtual const std::string* expression() const noexcept { return nullptr; }          // null: a table
  virtual const std::vector<double>* table() const noexcept { return nullptr; }       // null: an expression
  virtual double step() const noexcept { return 0; }                                  // of the table, m
};

namespace fs {

using Curve = fs_curve;

Ref<const Curve> make_table_curve(const double* forces, size_t count, double step);   // INVALID
Ref<const Curve> make_expression_curve(const char* text);                             // INVALID, PARSE

}  // namespace fs

// Numbers in sentences have a decimal point in every locale, as they have in files and URIs.
#pragma once

#include <locale.h>

namespace fs {

// While it exists, printf in this thread writes numbers with a decimal point.
class DecimalPoint {
 public:
  DecimalPoint() : before_(uselocale(c())) {}
  DecimalPoint(const DecimalPoint&) = delete;
  DecimalPoint& operator=(const DecimalPoint&) = delete;
  ~DecimalPoint() { uselocale(before_); }

 private:
  static locale_t c() {
    static const locale_t locale = newlocale(LC_ALL_MASK, "C", nullptr);
    return locale;
  }
  const locale_t before_;
};

}  // namespace fs

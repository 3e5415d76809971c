// The heights of a texture from an expression: worked out once, at the places of its grid.
#include <cmath>
#include <cstring>

#include "base/error.h"
#include "law/expression.h"
#include "law/texture.h"

namespace fs {

#ifdef FORCESERVER_EXPRESSIONS

std::vector<double> heights_of(const fs_surface_settings& settings, const char* text) {
  const std::string expression(text, strnlen(text, longest_expression + 1));
  check_expression(expression);
  Texture::check(settings);
  double place[3] = {};  // x, y, z
  const unsigned axis = settings.axis;
  double &column_place = place[axis % 3], &row_place = place[(axis + 1) % 3];
  std::vector<double> out;
  out.reserve(size_t{settings.columns} * settings.rows);
  try {
    mu::Parser parser = make_expression_parser();
    for (int i = 0; i < 3; ++i) parser.DefineVar(std::string(1, of_texture.letters[i]), &place[i]);
    parser.SetExpr(expression);
    parser.Eval();
    if (parser.GetNumResults() != 1) {
      fail(FS_ERROR_PARSE, "the expression gives %d numbers, must be one", parser.GetNumResults());
    }
    for (uint32_t row = 0; row < settings.rows; ++row) {
      row_place = settings.first_row + row * settings.row_width;
      for (uint32_t column = 0; column < settings.columns; ++column) {
        column_place = settings.first_column + column * settings.column_width;
        const double height = parser.Eval();
        if (!(height <= 0 && height >= -deepest_height)) {
          fail(FS_ERROR_INVALID, "the expression is %.9g at x = %.9g, y = %.9g, z = %.9g, must be within %g..0 m", height,
               place[0], place[1], place[2], -deepest_height);
        }
        out.push_back(height);
      }
    }
  } catch (const mu::ParserError& error) {
    fail_expression(expression, error, of_texture);
  }
  return out;
}

#else

std::vector<double> heights_of(const fs_surface_settings&, const char*) {
  fail(FS_ERROR_UNSUPPORTED, "a texture cannot be an expression: built without muParser");
}

#endif  // FORCESERVER_EXPRESSIONS

}  // namespace fs

#include "law/expression.h"

#ifdef FORCESERVER_EXPRESSIONS

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstring>

#include "base/error.h"

namespace fs {
namespace {

bool is_letter(char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; }

// Names from other languages and what they mean here.
constexpr struct {
  const char *name, *hint;
} hints[] = {
    {"pow", "write a^b"},     {"power", "write a^b"},      {"if", "write condition ? a : b"}, {"iff", "write condition ? a : b"},
    {"pi", "write _pi"},      {"m_pi", "write _pi"},       {"e", "write _e, or exp(a)"},      {"m_e", "write _e, or exp(a)"},
    {"fabs", "write abs(a)"}, {"round", "write rint(a)"},  {"sgn", "write sign(a)"},          {"lg", "write log10(a)"},
    {"lb", "write log2(a)"},  {"mean", "write avg(a, b)"}, {"and", "write a && b"},           {"or", "write a || b"},
    {"not", "write a == 0"},  {"arcsin", "write asin(a)"}, {"arccos", "write acos(a)"},       {"arctan", "write atan(a)"},
};

constexpr struct {
  const char *name, *hint;
} profile_hints[] = {
    {"x", "the distance is d"},        {"r", "the distance is d"}, {"dist", "the distance is d"},
    {"distance", "the distance is d"}, {"time", "the time is t"},
};

std::string names_of(const auto& map) {
  std::string out;
  for (const auto& entry : map) out += " " + entry.first;
  return out;
}

std::string sentence_on_name(const std::string& name, const Variables& variables) {
  const mu::Parser parser;
  std::string lower = name;
  std::transform(name.begin(), name.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  const auto& functions = parser.GetFunDef();
  if (functions.count(name)) return "it is a function: write " + name + "(...)";
  std::string hint;
  for (const auto& [other, text] : hints) {
    if (lower == other) hint = text;
  }
  for (const auto& [other, text] : profile_hints) {
    if (lower == other && variables.letters == of_profile.letters) hint = text;
  }
  const bool is_variable = lower.size() == 1 && std::strchr(variables.letters, lower[0]);
  if (functions.count(lower) || is_variable) hint = "write " + lower;
  return "the name is unknown" + (hint.empty() ? "" : " (" + hint + ")") + "; the names are " + variables.meaning + "," +
         names_of(parser.GetConst()) + names_of(functions);
}

// The index of the first ':' or the last '?' that has no partner.
size_t lonely_colon(const std::string& text) {
  for (size_t i = 0, open = 0; i < text.size(); ++i) {
    if (text[i] == '?') ++open;
    if (text[i] == ':' && open-- == 0) return i;
  }
  return text.find(':');
}
size_t lonely_question(const std::string& text) {
  for (size_t i = text.size(), colons = 0; i-- > 0;) {
    if (text[i] == ':') ++colons;
    if (text[i] == '?' && colons-- == 0) return i;
  }
  return text.find('?');
}
size_t lonely_bracket(const std::string& text) {
  for (size_t i = text.size(), closed = 0; i-- > 0;) {
    if (text[i] == ')') ++closed;
    if (text[i] == '(' && closed-- == 0) return i;
  }
  return text.find('(');
}

// For muParser. 0: there is no number here. It may then read what is too large or too small for a double in its own way.
int read_number(const char* text, int* place, double* out) {
  if (!std::isdigit(static_cast<unsigned char>(*text)) && *text != '.') return 0;
  const auto [end, error] = std::from_chars(text, text + std::strlen(text), *out);
  if (error != std::errc{}) return 0;
  *place += static_cast<int>(end - text);
  return 1;
}

}  // namespace

mu::Parser make_expression_parser() {
  mu::Parser parser;
  parser.AddValIdent(read_number);
  return parser;
}

void check_expression(const std::string& text) {
  if (text.find_first_not_of(' ') == std::string::npos) fail(FS_ERROR_PARSE, "the expression is empty");
  if (text.size() > longest_expression) {
    fail(FS_ERROR_INVALID, "the expression has more than %zu bytes", longest_expression);
  }
  std::string open;  // one for each open '(': 'f' when it begins the arguments of a function, otherwise '('
  for (size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    if (c < 0x20 || c > 0x7e) {
      fail(FS_ERROR_PARSE, "column %zu of the expression is byte 0x%02x, must be printable ASCII", i + 1, c);
    }
    if (c == '"') fail(FS_ERROR_PARSE, "column %zu of the expression is '\"': strings are not numbers", i + 1);
    if (std::strchr("<>!=", c) && text[i + 1] == '=') {
      ++i;
    } else if (c == '=') {
      fail(FS_ERROR_PARSE, "column %zu of the expression is '=': assignment is not allowed", i + 1);
    } else if (c == '(') {
      const size_t before = i == 0 ? std::string::npos : text.find_last_not_of(' ', i - 1);
      const bool is_call = before != std::string::npos && is_letter(text[before]);
      open.push_back(is_call ? 'f' : '(');
    } else if (c == ')' && !open.empty()) {
      open.pop_back();
    } else if (c == ',' && (open.empty() || open.back() != 'f')) {
      fail(FS_ERROR_PARSE, "column %zu of the expression is ',' outside of a call: it must give one number", i + 1);
    }
  }
}

void fail_expression(const std::string& text, const mu::ParserError& error, const Variables& variables) {
  const std::string& token = error.GetToken();
  size_t place = std::min(static_cast<size_t>(std::max(0, static_cast<int>(error.GetPos()))), text.size() - 1);
  std::string sentence = error.GetMsg();
  switch (error.GetCode()) {
    case mu::ecUNASSIGNABLE_TOKEN:
      sentence = is_letter(text[place]) ? sentence_on_name(token, variables)
                                        : "it is not an operator; use + - * / ^ < > <= >= == != && || and a ? b : c";
      break;
    case mu::ecUNEXPECTED_EOF:
      place = text.find_last_not_of(' ');
      sentence = "a value is missing after it";
      break;
    case mu::ecMISSING_PARENS:
      place = lonely_bracket(text);
      sentence = "it is not closed";
      break;
    case mu::ecTOO_MANY_PARAMS:
    case mu::ecTOO_FEW_PARAMS:
      place = text.rfind(token, place);
      sentence = error.GetCode() == mu::ecTOO_MANY_PARAMS ? "it has too many arguments" : "it has too few arguments";
      break;
    case mu::ecMISSING_ELSE_CLAUSE:
      place = lonely_question(text);
      sentence = "its ':' is missing; write condition ? a : b";
      break;
    case mu::ecMISPLACED_COLON:
      place = lonely_colon(text);
      sentence = "its '?' is missing; write condition ? a : b";
      break;
    case mu::ecUNEXPECTED_OPERATOR:
      sentence = text[place] == '*' && place > 0 && text[place - 1] == '*' ? "a value is missing before it (write a^b)"
                                                                           : "a value is missing before it";
      break;
    case mu::ecUNEXPECTED_CONDITIONAL:
    case mu::ecUNEXPECTED_ARG_SEP: sentence = "a value is missing before it"; break;
    case mu::ecUNEXPECTED_PARENS:
      sentence =
          text[place] == '(' ? "an operator is missing before it" : "there is one too many, or a value is missing before it";
      break;
    case mu::ecUNEXPECTED_VAL:
    case mu::ecUNEXPECTED_VAR:
    case mu::ecUNEXPECTED_FUN: sentence = "an operator is missing before it"; break;
    default: break;
  }
  place = std::min(place, text.size() - 1);
  size_t end = place + 1;
  while (is_letter(text[place]) && end < text.size() && is_letter(text[end])) ++end;
  fail(FS_ERROR_PARSE, "column %zu of the expression, at '%s': %s", place + 1, text.substr(place, end - place).c_str(),
       sentence.c_str());
}

bool mentions_time(const std::string& text) {
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] == 't' && !(i > 0 && is_letter(text[i - 1])) && !is_letter(text[i + 1])) return true;
  }
  return false;
}

}  // namespace fs

#endif  // FORCESERVER_EXPRESSIONS

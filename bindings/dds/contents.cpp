#include "contents.h"

#include <algorithm>
#include <cstdio>

#include "hash.h"
#include "say.h"

namespace bridge {
namespace {

constexpr size_t points_a_piece = 2700, indices_a_piece = 16200, numbers_a_piece = 8192;  // as in forceserver.idl
constexpr double rate = 10e6 / 8;           // bytes a second of pieces
constexpr double most_at_once = 65536;      // bytes
constexpr uint32_t most_pieces = 65536;
constexpr size_t most_bytes = size_t{1} << 30;  // of contents that are not complete
constexpr size_t bytes_a_piece = 80;            // for its place, before it has come

uint32_t pieces_for(size_t count, size_t a_piece) { return static_cast<uint32_t>((count + a_piece - 1) / a_piece); }

std::string hexadecimal(uint64_t high, uint64_t low) {
  char out[33];
  std::snprintf(out, sizeof out, "%016llx%016llx", static_cast<unsigned long long>(high), static_cast<unsigned long long>(low));
  return out;
}

// A hash of 128 bits of several blocks of bytes.
class Hash {
 public:
  void add(const void* data, size_t size) {
    high_ = hash_of(data, size, high_);
    low_ = hash_of(data, size, low_);
  }
  std::string text() const { return hexadecimal(high_, low_); }

 private:
  uint64_t high_ = 0xcbf29ce484222325, low_ = 0x9e3779b97f4a7c15;
};

std::string key_of(fs_shape* shape) {
  fs_shape_info info = fs_shape_info_init();
  forceserver::throw_on_error(fs_shape_get_info(shape, &info));
  return hexadecimal(info.content[0], info.content[1]);
}

std::string key_of(fs_curve* curve) {
  Hash hash;
  if (const char* const expression = fs_curve_get_expression(curve)) {
    hash.add(expression, std::strlen(expression));
    return hash.text();
  }
  size_t count = 0;
  double step = 0;
  const double* const table = fs_curve_get_table(curve, &count, &step);
  hash.add(&step, sizeof step);
  hash.add(table, count * sizeof *table);
  return hash.text();
}

std::string key_of(fs_surface* surface) {
  fs_surface_settings settings = fs_surface_settings_init();
  forceserver::throw_on_error(fs_surface_get_settings(surface, &settings));
  size_t count = 0;
  const double* const heights = fs_surface_get_heights(surface, &count);
  Hash hash;
  hash.add(&settings, sizeof settings);
  hash.add(heights, count * sizeof *heights);
  return hash.text();
}

// Keys that are a hash are checked; a program that cannot work the hash out gives its content another name.
bool is_hash(const std::string& key) {
  return key.size() == 32 && key.find_first_not_of("0123456789abcdef") == std::string::npos;
}

forceserver_Surface to_sample(const fs_surface_settings& s) {
  forceserver_Surface out{};
  out.static_friction = s.static_friction;
  out.dynamic_friction = s.dynamic_friction;
  out.slip_distance = s.slip_distance;
  out.columns = s.columns;
  out.rows = s.rows;
  out.axis = s.axis;
  out.repeats = s.repeats;
  out.column_width = s.column_width;
  out.row_width = s.row_width;
  out.first_column = s.first_column;
  out.first_row = s.first_row;
  out.impact_gain = s.impact_gain;
  out.impact_frequency = s.impact_frequency;
  out.impact_decay = s.impact_decay;
  return out;
}

fs_surface_settings to_c(const forceserver_Surface& s) {
  fs_surface_settings out = fs_surface_settings_init();
  out.static_friction = s.static_friction;
  out.dynamic_friction = s.dynamic_friction;
  out.slip_distance = s.slip_distance;
  out.columns = s.columns;
  out.rows = s.rows;
  out.axis = static_cast<fs_axis>(s.axis & 0x7fffffff);
  out.repeats = s.repeats;
  out.column_width = s.column_width;
  out.row_width = s.row_width;
  out.first_column = s.first_column;
  out.first_row = s.first_row;
  out.impact_gain = s.impact_gain;
  out.impact_frequency = s.impact_frequency;
  out.impact_decay = s.impact_decay;
  return out;
}

struct Slice {
  size_t begin, count;
};
Slice slice(uint32_t piece, size_t a_piece, size_t count) {
  const size_t begin = std::min(count, piece * a_piece);
  return {begin, std::min(a_piece, count - begin)};
}

// What is to be sent of a content.
struct Source {
  explicit Source(const Content& content) {
    if (content.shape) {
      points = fs_shape_get_points(content.shape.get(), &point_count);
      triangles = fs_shape_get_triangles(content.shape.get(), &index_count);
      index_count *= 3;
      point_pieces = pieces_for(point_count, points_a_piece);
      pieces = point_pieces + pieces_for(index_count, indices_a_piece);
    } else if (content.curve) {
      expression = fs_curve_get_expression(content.curve.get());
      if (!expression) numbers = fs_curve_get_table(content.curve.get(), &count, &step);
      pieces = std::max(1u, pieces_for(count, numbers_a_piece));
    } else {
      numbers = fs_surface_get_heights(content.surface.get(), &count);
      pieces = std::max(1u, pieces_for(count, numbers_a_piece));
    }
  }
  uint32_t pieces = 0, point_pieces = 0;
  const fs_vec3* points = nullptr;
  const uint32_t* triangles = nullptr;
  const double* numbers = nullptr;
  const char* expression = nullptr;
  size_t point_count = 0, index_count = 0, count = 0;
  double step = 0;
};

static_assert(sizeof(forceserver_Vec3) == sizeof(fs_vec3));

template <class T, class Sequence>
void lend_part(Sequence& sequence, const T* data, const Slice& part) {
  using Item = std::remove_pointer_t<decltype(sequence._buffer)>;
  sequence._buffer = const_cast<Item*>(reinterpret_cast<const Item*>(data)) + part.begin;  // DDS only reads it
  sequence._length = sequence._maximum = static_cast<uint32_t>(part.count);
}

template <class T>
std::vector<T> joined(std::vector<std::vector<T>>& pieces) {
  size_t size = 0;
  for (const std::vector<T>& piece : pieces) size += piece.size();
  std::vector<T> out;
  out.reserve(size);
  for (std::vector<T>& piece : pieces) {
    out.insert(out.end(), piece.begin(), piece.end());
    piece = {};
  }
  return out;
}

// What is taken back comes with its numbers, but without points.
bool is_piece(const dds_sample_info_t& info) {
  return info.valid_data && info.instance_state != DDS_NOT_ALIVE_DISPOSED_INSTANCE_STATE;
}

void require_key(const std::string& key, const std::string& real) {
  if (is_hash(key) && key != real) throw std::runtime_error("the content of " + key + " is another one, of " + real);
}

}  // namespace

ContentRef content_of(fs_shape* shape) {
  if (!shape) return nullptr;
  return std::make_shared<Content>(Content{key_of(shape), forceserver::Shape(fs_shape_retain(shape)), {}, {}});
}
ContentRef content_of(fs_curve* curve) {
  if (!curve) return nullptr;
  return std::make_shared<Content>(Content{key_of(curve), {}, forceserver::Curve(fs_curve_retain(curve)), {}});
}
ContentRef content_of(fs_surface* surface) {
  if (!surface) return nullptr;
  return std::make_shared<Content>(Content{key_of(surface), {}, {}, forceserver::Surface(fs_surface_retain(surface))});
}

ContentsOfObject ContentsOfObject::of(const fs_object& object) {
  return {content_of(object.shape), content_of(object.surface), content_of(object.front.curve), content_of(object.back.curve)};
}

void ContentsOfObject::put_keys(forceserver_ForceObject& out) const {
  const auto key = [](const ContentRef& content) { return content ? content->key : std::string(); };
  put_text(out.form, key(shape));
  put_text(out.finish, key(surface));
  put_text(out.front.curve, key(front));
  put_text(out.back.curve, key(back));
}

void ContentsOfObject::put_handles(fs_object& out) const {
  if (shape) out.shape = shape->shape.get();
  if (surface) out.surface = surface->surface.get();
  if (front) out.front.curve = front->curve.get();
  if (back) out.back.curve = back->curve.get();
}

// ------------------------------------------------------------------------------------------------------------- writing

ContentRef ContentWriter::find(const std::string& key) const {
  const auto found = entries_.find(key);
  return found == entries_.end() ? nullptr : found->second.content;
}

void ContentWriter::use(const ContentRef& content) {
  if (!content) return;
  Entry& entry = entries_[content->key];
  if (!entry.content) {
    entry.content = content;
    queue(content->key);
  }
  ++entry.uses;
}

void ContentWriter::unuse(const std::string& key, double now) {
  const auto found = entries_.find(key);
  if (found == entries_.end() || found->second.uses == 0) return;
  if (--found->second.uses == 0) found->second.unused_since = now;
}

void ContentWriter::queue(const std::string& key) {
  const bool is_queued = std::any_of(queue_.begin(), queue_.end(), [&](const Next& next) { return next.key == key; });
  if (!is_queued) queue_.push_back({key});
}

void ContentWriter::write_again(const std::string& key) {
  if (entries_.count(key)) queue(key);
}

void ContentWriter::write_all_again() {
  for (const auto& [key, entry] : entries_) queue(key);
}

bool ContentWriter::write_piece(const Content& content, uint32_t piece, bool disposes, size_t& bytes) const {
  const Source source(content);
  const auto send = [disposes](const auto& writer, const auto& sample) {
    return disposes ? writer.dispose(sample) : writer.write(sample);
  };
  if (content.shape) {
    forceserver_Shape sample{};
    put_text(sample.content, content.key);
    sample.piece = piece;
    sample.pieces = source.pieces;
    fs_shape_info info = fs_shape_info_init();
    fs_shape_get_info(content.shape.get(), &info);
    sample.primitive = info.primitive;
    sample.is_closed = info.primitive == FS_PRIMITIVE_POLYLINE && info.closed;
    if (!disposes && piece < source.point_pieces) {
      lend_part(sample.points, source.points, slice(piece, points_a_piece, source.point_count));
    } else if (!disposes) {
      lend_part(sample.triangles, source.triangles, slice(piece - source.point_pieces, indices_a_piece, source.index_count));
    }
    bytes = sample.points._length * sizeof(fs_vec3) + sample.triangles._length * sizeof(uint32_t);
    return send(room_.shapes.writer, sample);
  }
  const Slice part = disposes ? Slice{0, 0} : slice(piece, numbers_a_piece, source.count);
  bytes = part.count * sizeof(double) + 256;
  if (content.curve) {
    forceserver_Curve sample{};
    put_text(sample.content, content.key);
    sample.piece = piece;
    sample.pieces = source.pieces;
    if (source.expression) put_text(sample.expression, source.expression);
    sample.step = source.step;
    lend_part(sample.forces, source.numbers, part);
    return send(room_.curves.writer, sample);
  }
  fs_surface_settings settings = fs_surface_settings_init();
  fs_surface_get_settings(content.surface.get(), &settings);
  forceserver_Surface sample = to_sample(settings);
  put_text(sample.content, content.key);
  sample.piece = piece;
  sample.pieces = source.pieces;
  lend_part(sample.heights, source.numbers, part);
  return send(room_.surfaces.writer, sample);
}

void ContentWriter::write(double now) {
  allowance_ = std::min(most_at_once, allowance_ + rate * std::max(0.0, now - last_));
  last_ = now;
  drop_unused(now);
  size_t bytes = 0;
  while (!queue_.empty() && allowance_ > 0) {
    Next& next = queue_.front();
    const auto found = entries_.find(next.key);
    if (found == entries_.end() || next.piece >= Source(*found->second.content).pieces) {
      queue_.pop_front();
      continue;
    }
    if (!write_piece(*found->second.content, next.piece, false, bytes)) return;
    ++next.piece;
    allowance_ -= static_cast<double>(bytes);
  }
  for (int i = 0; i < 100 && !disposed_.empty(); ++i) {
    auto& [content, piece] = disposed_.front();
    if (!write_piece(*content, piece, true, bytes)) return;
    if (++piece >= Source(*content).pieces) disposed_.pop_front();
  }
}

// A slider goes to and fro: what nobody uses is kept for a while.
void ContentWriter::drop_unused(double now) {
  constexpr double kept = 10;  // s
  std::erase_if(entries_, [&](const auto& entry) {
    const bool is_over = entry.second.uses == 0 && now - entry.second.unused_since > kept;
    if (is_over) disposed_.emplace_back(entry.second.content, 0);
    return is_over;
  });
}

// ------------------------------------------------------------------------------------------------------------- reading

void ContentReader::take(double now) {
  now_ = now;
  room_.shapes.reader.take([&](const forceserver_Shape& sample, const dds_sample_info_t& info) {
    if (!is_piece(info)) return;
    const std::string key = text_of(sample.content);
    const size_t bytes = sample.points._length * sizeof(fs_vec3) + sample.triangles._length * sizeof(uint32_t);
    const PartsRef parts = open(shape_kind, key, sample.piece, sample.pieces, bytes);
    if (!parts) return;
    parts->shape = sample;
    const auto* const points = reinterpret_cast<const fs_vec3*>(sample.points._buffer);
    parts->points[sample.piece].assign(points, points + sample.points._length);
    parts->triangles[sample.piece].assign(sample.triangles._buffer, sample.triangles._buffer + sample.triangles._length);
    close(shape_kind, key, parts, sample.piece);
  });
  room_.curves.reader.take([&](const forceserver_Curve& sample, const dds_sample_info_t& info) {
    if (!is_piece(info)) return;
    const std::string key = text_of(sample.content);
    const PartsRef parts = open(curve_kind, key, sample.piece, sample.pieces, sample.forces._length * sizeof(double));
    if (!parts) return;
    parts->curve = sample;
    parts->numbers[sample.piece].assign(sample.forces._buffer, sample.forces._buffer + sample.forces._length);
    close(curve_kind, key, parts, sample.piece);
  });
  room_.surfaces.reader.take([&](const forceserver_Surface& sample, const dds_sample_info_t& info) {
    if (!is_piece(info)) return;
    const std::string key = text_of(sample.content);
    const PartsRef parts = open(surface_kind, key, sample.piece, sample.pieces, sample.heights._length * sizeof(double));
    if (!parts) return;
    parts->surface = sample;
    parts->numbers[sample.piece].assign(sample.heights._buffer, sample.heights._buffer + sample.heights._length);
    close(surface_kind, key, parts, sample.piece);
  });
}

ContentReader::PartsRef ContentReader::open(Kind kind, const std::string& key, uint32_t piece, uint32_t pieces, size_t bytes) {
  const bool makes_sense = !key.empty() && piece < pieces && pieces <= most_pieces;
  if (!makes_sense || ready_.count(key) || bad_.count(key)) return nullptr;
  if (!parts_.count({kind, key})) bytes += pieces * bytes_a_piece;
  if (bytes_ + bytes > most_bytes || parts_.size() > most_pieces) {
    if (!is_full_told_) complain("other sites' shapes need more than 1 GB; some are left out");
    is_full_told_ = true;
    return nullptr;
  }
  PartsRef& parts = parts_[{kind, key}];
  if (parts && (parts->pieces != pieces || parts->is_being_made || parts->has[piece])) return nullptr;
  if (!parts) {
    parts = std::make_shared<Parts>();
    parts->pieces = pieces;
    parts->has.resize(pieces);
    parts->points.resize(pieces);
    parts->triangles.resize(pieces);
    parts->numbers.resize(pieces);
  }
  parts->bytes += bytes;
  bytes_ += bytes;
  return parts;
}

void ContentReader::close(Kind kind, const std::string& key, const PartsRef& parts, uint32_t piece) {
  parts->has[piece] = true;
  parts->arrived = now_;
  // It is on its way: were it written again now, that would replace what DDS is still sending, and it would begin anew.
  const auto wanted = wanted_.find(key);
  if (wanted != wanted_.end()) wanted->second = now_;
  if (++parts->received < parts->pieces) return;
  parts->is_being_made = true;
  worker_.start([this, kind, key, parts]() -> Worker::Done {
    ContentRef made;
    try {
      if (kind == shape_kind) {
        const std::vector<fs_vec3> points = joined(parts->points);
        const std::vector<uint32_t> indices = joined(parts->triangles);
        fs_shape* shape = nullptr;
        const bool is_mesh = parts->shape.primitive == FS_PRIMITIVE_MESH;
        forceserver::throw_on_error(is_mesh
                                        ? fs_shape_create_mesh(points.data(), points.size(), indices.data(), indices.size() / 3,
                                                               &shape)
                                        : fs_shape_create_polyline(points.data(), points.size(), parts->shape.is_closed, &shape));
        const forceserver::Shape owned(shape);
        made = content_of(owned.get());
      } else if (kind == curve_kind) {
        const std::vector<double> forces = joined(parts->numbers);
        const std::string expression = text_of(parts->curve.expression);
        const forceserver::Curve owned = expression.empty()
                                             ? forceserver::Curve::create_table(forces.data(), forces.size(), parts->curve.step)
                                             : forceserver::Curve::create_expression(expression);
        made = content_of(owned.get());
      } else {
        const std::vector<double> heights = joined(parts->numbers);
        const fs_surface_settings settings = to_c(parts->surface);
        const forceserver::Surface owned = heights.empty()
                                               ? forceserver::Surface::create(settings)
                                               : forceserver::Surface::create_texture(settings, heights.data(), heights.size());
        made = content_of(owned.get());
      }
      require_key(key, made->key);
    } catch (const std::exception& error) {
      complain("content " + key + " of another site: " + error.what());
      made = nullptr;
    }
    return [this, kind, key, parts, made] {
      bytes_ -= parts->bytes;
      parts_.erase({kind, key});
      keep(made, key);
    };
  });
}

void ContentReader::keep(const ContentRef& content, const std::string& key) {
  wanted_.erase(key);
  if (!content) {
    if (bad_.size() < most_pieces) bad_[key] = now_;
    return;
  }
  ready_[key].content = content;
  ++news_;
}

ContentRef ContentReader::find(const std::string& key, double now) {
  const auto found = ready_.find(key);
  if (found == ready_.end()) {
    if (!bad_.count(key) && wanted_.size() < most_pieces) wanted_.emplace(key, now);
    return nullptr;
  }
  found->second.used = now;
  return found->second.content;
}

std::vector<std::string> ContentReader::wanted(double now) const {
  std::vector<std::string> out;
  for (const auto& [key, since] : wanted_) {
    if (out.size() < 16 && now - since > 5) out.push_back(key);
  }
  return out;
}

void ContentReader::drop_unused(double now) {
  constexpr double kept = 60;  // s
  for (auto& [key, ready] : ready_) {
    if (ready.content.use_count() > 1 || ready.used == 0) ready.used = now;
  }
  // Their writer may be gone. What is needed is asked for anew.
  std::erase_if(parts_, [&](const auto& entry) {
    const bool is_over = !entry.second->is_being_made && now - entry.second->arrived > kept;
    if (is_over) bytes_ -= entry.second->bytes;
    return is_over;
  });
  std::erase_if(bad_, [&](const auto& entry) { return now - entry.second > kept; });
  std::erase_if(ready_, [&](const auto& entry) { return now - entry.second.used > kept; });
  std::erase_if(wanted_, [&](const auto& entry) { return now - entry.second > 600; });  // its objects have gone
}

}  // namespace bridge

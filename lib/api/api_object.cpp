#include <forceserver/object.h>

#include <algorithm>

#include "api/guarded.h"
#include "base/grown.h"
#include "base/names.h"
#include "base/text.h"
#include "field/object.h"
#include "file/mesh_file.h"
#include "law/profile.h"

using namespace fs;

const char* fs_primitive_name(fs_primitive primitive) { return name_of(primitive_names, primitive, "an unknown fs_primitive"); }

const char* fs_profile_kind_name(fs_profile_kind kind) { return name_of(profile_kind_names, kind, "an unknown fs_profile_kind"); }

const char* fs_sense_name(fs_sense sense) { return name_of(sense_names, sense, "an unknown fs_sense"); }

void fs_object_release(fs_object* object) {
  if (!object || !object->owner) return;
  Ref<const Object>::adopt(static_cast<const Object*>(object->owner));
  object->owner = nullptr;
}

namespace {

// Another client's object, whose name is "CLIENT/NAME", with the name that its client gave it; any other as it is.
fs_object without_client(const fs_object& object) {
  fs_object out = object;
  const std::string name = text_of(object.name);
  const size_t slash = name.find('/');
  if (slash == std::string::npos) return out;
  std::memset(out.name, 0, sizeof out.name);
  std::memcpy(out.name, name.data() + slash + 1, name.size() - slash - 1);
  return out;
}

// What fs_profile_evaluate and fs_object_evaluate_law have in common: checks all but the profile or object.
void check_places(double max_stiffness, double t, const double* distances, size_t count, bool may_be_negative) {
  if (!(max_stiffness >= 0) || !std::isfinite(max_stiffness)) {
    fail(FS_ERROR_INVALID, "max_stiffness is %.9g, must be finite and >= 0 N/m", max_stiffness);
  }
  parse_finite(t, "t");
  for (size_t i = 0; i < count; ++i) {
    if (!std::isfinite(distances[i]) || !(distances[i] >= 0 || may_be_negative)) {
      fail(FS_ERROR_INVALID, "distances[%zu] is %.9g, must be finite%s", i, distances[i], may_be_negative ? "" : " and >= 0 m");
    }
  }
}

Law with_slope(const Law& law, double max_stiffness) { return max_stiffness > 0 ? capped(law, max_stiffness) : law; }

}  // namespace

fs_status fs_profile_evaluate(const fs_profile* profile, double max_stiffness, double t, const double* distances, size_t count,
                              double* forces) {
  return guarded([&] {
    require_pointer(profile, "profile");
    if (count) {
      require_pointer(distances, "distances");
      require_pointer(forces, "forces");
    }
    Law law;
    law.front = parse_profile(*profile, "profile");
    check_places(max_stiffness, t, distances, count, false);
    law = with_slope(law, max_stiffness);
    const Law::Parsers parsers = law.make_parsers();
    for (size_t i = 0; i < count; ++i) forces[i] = evaluate(law.front, parsers.front.get(), std::fabs(distances[i]), t).force;
  });
}

fs_status fs_object_evaluate_law(const fs_object* object, double max_stiffness, double t, const double* distances, size_t count,
                                 double* forces) {
  return guarded([&] {
    require_pointer(object, "object");
    if (count) {
      require_pointer(distances, "distances");
      require_pointer(forces, "forces");
    }
    const Ref<const Object> parsed = parse_object(without_client(read_grown(object)), nullptr, false).object;
    check_places(max_stiffness, t, distances, count, true);
    const Law law = with_slope(parsed->law, max_stiffness);
    const Law::Parsers parsers = law.make_parsers();
    const bool has_sides = parsed->primitive == FS_PRIMITIVE_PLANE || parsed->primitive == FS_PRIMITIVE_MESH;
    for (size_t i = 0; i < count; ++i) {
      const double s = distances[i];
      if (has_sides) {
        forces[i] = law.at(s, t, &parsers).force;
      } else {
        forces[i] = s == 0 ? 0 : std::copysign(1.0, s) * law.at(std::fabs(s), t, &parsers).force;
      }
    }
  });
}

// ----------------------------------------------------------------------------------------------------------- shapes

namespace {
void give(Ref<const Shape> shape, fs_shape** out) { *out = const_cast<fs_shape*>(shape.detach()); }
void give(Ref<const Surface> surface, fs_surface** out) { *out = const_cast<fs_surface*>(surface.detach()); }
void give(Ref<const Curve> curve, fs_curve** out) { *out = const_cast<fs_curve*>(curve.detach()); }
}  // namespace

fs_status fs_shape_create_polyline(const fs_vec3* points, size_t count, bool closed, fs_shape** out) {
  return guarded([&] {
    require_pointer(points, "points");
    require_pointer(out, "out");
    give(make_polyline(points, count, closed), out);
  });
}

fs_status fs_shape_create_mesh(const fs_vec3* points, size_t point_count, const uint32_t* triangles, size_t triangle_count,
                               fs_shape** out) {
  return guarded([&] {
    require_pointer(points, "points");
    require_pointer(triangles, "triangles");
    require_pointer(out, "out");
    give(make_mesh(points, point_count, triangles, triangle_count), out);
  });
}

fs_status fs_shape_load(const char* path, double scale, fs_shape** out) {
  return guarded([&] {
    require_pointer(path, "path");
    require_pointer(out, "out");
    MeshData mesh = read_mesh_file(path, scale);
    StopToken stop;
    give(make_mesh(std::move(mesh.points), std::move(mesh.triangles), stop), out);
  });
}

fs_status fs_shape_build(fs_shape* shape) {
  return guarded([&] {
    require_pointer(shape, "shape");
    shape->build();
  });
}

fs_status fs_shape_get_progress(const fs_shape* shape, double* out) {
  if (!shape) return null_argument("shape is null");
  if (!out) return null_argument("out is null");
  *out = shape->progress();
  return FS_OK;
}

fs_shape* fs_shape_retain(fs_shape* shape) {
  if (shape) shape->retain();
  return shape;
}

void fs_shape_destroy(fs_shape* shape) {
  if (shape) shape->release();
}

const fs_vec3* fs_shape_get_points(const fs_shape* shape, size_t* count) {
  if (count) *count = shape ? shape->points.size() : 0;
  if (!shape || !count) {
    null_argument(shape ? "count is null" : "shape is null");
    return nullptr;
  }
  return shape->points.data();
}

const uint32_t* fs_shape_get_triangles(const fs_shape* shape, size_t* count) {
  if (count) *count = shape ? shape->triangles.size() / 3 : 0;
  if (!shape || !count) {
    null_argument(shape ? "count is null" : "shape is null");
    return nullptr;
  }
  return shape->triangles.empty() ? nullptr : shape->triangles.data();
}

fs_status fs_shape_get_info(const fs_shape* shape, fs_shape_info* out) {
  return guarded([&] {
    require_pointer(shape, "shape");
    require_pointer(out, "out");
    check_grown(out);
    fs_shape_info info = fs_shape_info_init();
    shape->get_info(info);
    if (knows(*out, out->content)) {
      const std::array<uint64_t, 2> content = shape->content();
      std::copy(content.begin(), content.end(), info.content);
    }
    write_grown(info, out);
  });
}

// ----------------------------------------------------------------------------------------------------------- curves

fs_status fs_curve_create_table(const double* forces, size_t count, double step, fs_curve** out) {
  return guarded([&] {
    require_pointer(forces, "forces");
    require_pointer(out, "out");
    give(make_table_curve(forces, count, step), out);
  });
}

fs_status fs_curve_create_expression(const char* text, fs_curve** out) {
  return guarded([&] {
    require_pointer(text, "text");
    require_pointer(out, "out");
    give(make_expression_curve(text), out);
  });
}

const char* fs_curve_get_expression(const fs_curve* curve) {
  if (!curve) {
    null_argument("curve is null");
    return nullptr;
  }
  const std::string* text = curve->expression();
  return text ? text->c_str() : nullptr;
}

const double* fs_curve_get_table(const fs_curve* curve, size_t* count, double* step) {
  if (count) *count = 0;
  if (step) *step = 0;
  if (!curve || !count || !step) {
    null_argument(!curve ? "curve is null" : !count ? "count is null" : "step is null");
    return nullptr;
  }
  const std::vector<double>* table = curve->table();
  if (!table) return nullptr;
  *count = table->size();
  *step = curve->step();
  return table->data();
}

fs_curve* fs_curve_retain(fs_curve* curve) {
  if (curve) curve->retain();
  return curve;
}

void fs_curve_destroy(fs_curve* curve) {
  if (curve) curve->release();
}

// --------------------------------------------------------------------------------------------------------- surfaces

fs_status fs_surface_create(const fs_surface_settings* settings, fs_surface** out) {
  return guarded([&] {
    require_pointer(settings, "settings");
    require_pointer(out, "out");
    give(make_surface(read_grown(settings)), out);
  });
}

fs_status fs_surface_set_impact(fs_surface_settings* settings, fs_impact impact) {
  return guarded([&] {
    require_pointer(settings, "settings");
    fs_surface_settings known = read_grown(settings);
    const int32_t kind = raw_value(impact);
    if (kind < FS_IMPACT_NONE || kind > FS_IMPACT_HARD) {
      fail(FS_ERROR_INVALID, "impact is %d, must be an fs_impact (0..3)", kind);
    }
    const Impact of = impact_preset(impact);
    known.impact_gain = of.gain;
    known.impact_frequency = of.frequency;
    known.impact_decay = of.decay;
    write_grown(known, settings);
  });
}

fs_status fs_surface_create_texture(const fs_surface_settings* settings, const double* heights, size_t count, fs_surface** out) {
  return guarded([&] {
    require_pointer(settings, "settings");
    require_pointer(heights, "heights");
    require_pointer(out, "out");
    if (count == 0) fail(FS_ERROR_INVALID, "count is 0, must be columns * rows");
    give(make_surface(read_grown(settings), {heights, count}), out);
  });
}

fs_status fs_surface_create_expression(const fs_surface_settings* settings, const char* text, fs_surface** out) {
  return guarded([&] {
    require_pointer(settings, "settings");
    require_pointer(text, "text");
    require_pointer(out, "out");
    const fs_surface_settings known = read_grown(settings);
    give(make_surface(known, heights_of(known, text)), out);
  });
}

const double* fs_surface_get_heights(const fs_surface* surface, size_t* count) {
  if (count) *count = 0;
  if (!surface || !count) {
    null_argument(!surface ? "surface is null" : "count is null");
    return nullptr;
  }
  if (!surface->texture) return nullptr;
  *count = surface->texture->heights().size();
  return surface->texture->heights().data();
}

fs_status fs_surface_get_settings(const fs_surface* surface, fs_surface_settings* out) {
  return guarded([&] {
    require_pointer(surface, "surface");
    require_pointer(out, "out");
    write_grown(surface->settings, out);
  });
}

fs_surface* fs_surface_retain(fs_surface* surface) {
  if (surface) surface->retain();
  return surface;
}

void fs_surface_destroy(fs_surface* surface) {
  if (surface) surface->release();
}

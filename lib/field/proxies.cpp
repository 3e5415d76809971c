#include "field/proxies.h"

#include <algorithm>
#include <cmath>

#include "field/fit.h"

namespace fs {
namespace {

constexpr double spread_time = 0.02;  // s, over which a jump is spread

}  // namespace

void Proxies::begin(double now, uint32_t views) noexcept {
  views_left_ = views;
  step_ = std::clamp(now - now_, 0.0, 0.1);
  now_ = now;
  touches_.begin();
}

// Room for a solid that was felt in the last tick is made by the newest that was not.
void Proxies::replace_one(uint32_t view, uint64_t what, const Solid& solid) noexcept {
  const Touches::View* const last = touches_.last(view, what);
  const auto was_felt = [&](const Solid& one) {
    for (uint32_t n = 0; last && n < last->layer_count; ++n) {  // the pulls of a layer are in the order of rows
      const std::span<const Pull> pulls = touches_.last_pulls(last->layers[n]);
      const auto at =
          std::lower_bound(pulls.begin(), pulls.end(), one.row, [](const Pull& p, uint32_t row) { return p.row < row; });
      if (at != pulls.end() && at->row == one.row && at->version == one.version) return true;
    }
    return false;
  };
  if (!was_felt(solid)) return;
  uint32_t gone = solid_count_;
  while (gone > 0 && was_felt(solids_[gone - 1])) --gone;
  if (gone == 0) return;
  std::copy(solids_.begin() + gone, solids_.begin() + solid_count_, solids_.begin() + gone - 1);
  solids_[solid_count_ - 1] = solid;
}

// ---------------------------------------------------------------------------------------------------------- one layer

void Proxies::begin_layer(const Layer& layer) noexcept {
  for (uint32_t i = 0; i < solid_count_; ++i) {
    Solid& solid = solids_[i];
    const uint32_t number = layers_.number(i);
    solid.is_present = number == Touches::most_chosen || (layer.present & bit_of(number));
    solid.is_touched = solid.is_known = false;
    solid.spring = solid.damping = solid.felt = {};
    solid.stiffness = solid.felt_stiffness = {};
  }
}

void Proxies::end_layer(Touches::View& here, Layer& layer, const ToolState& tool, Sum& out) noexcept {
  for (Solid& solid : solids()) {
    if (!solid.is_present) continue;
    if (tool.count > 1) {  // the limit is that of all points; each point keeps it by itself
      const double limit = solid.object->contact.limit, part = part_within(limit, norm(solid.spring.force));
      if (part < 1) solid.stiffness = part * (across(solid.spring.force) * solid.stiffness);
      solid.spring = part * solid.spring;
      solid.damping = part_beside(limit, solid.spring.force, solid.damping.force) * solid.damping;
    }
    out.stiffness += layer.length() * (solid.stiffness + solid.felt_stiffness);
    solid.sum = solid.sum + layer.length() * (solid.spring + solid.damping + solid.felt);
    solid.is_touched_at_all |= solid.is_touched;
    if (!solid.is_touched && solid.felt.force == Vec3{}) continue;
    solid.is_felt_at_all = true;
    touches_.add_pull(here, layer, {solid.row, solid.version, solid.spring, solid.felt});
  }
}

// Whether each solid that is felt in this layer, or was felt in the one before, is there in both. Where one comes or goes the
// forces differ for that reason, and nothing need be spread: the length of the layer grows or shrinks by steps of its weight.
bool Proxies::is_same(const Layer& before) const noexcept {
  for (uint32_t i = 0; i < solid_count_; ++i) {
    if (solids_[i].is_touched && !solids_[i].is_known) return false;
  }
  for (const Pull& pull : touches_.last_pulls(before)) {
    bool is_there = false;
    for (uint32_t i = 0; i < solid_count_ && !is_there; ++i) {
      is_there = solids_[i].version == pull.version && solids_[i].is_present;
    }
    if (!is_there) return false;
  }
  return true;
}

// A change that the ways of hand and objects do not explain is a jump: the solids keep it for a while. then, now: layers of
// the last tick and of this one, whose pulls count by the length of their own layer, or by `length` if it is above 0.
// explained: N.
void Proxies::spread_jump(Wrench Pull::* part, std::span<const Layer> then, std::span<const Layer> now, double length,
                          double explained, Rests& out) noexcept {
  const auto for_each_change = [&](auto&& f) {
    for (const Layer& layer : then) {
      for (const Pull& pull : touches_.last_pulls(layer)) f(pull.version, (length > 0 ? length : layer.length()) * (pull.*part));
    }
    for (const Layer& layer : now) {
      for (const Pull& pull : touches_.pulls(layer)) f(pull.version, -(length > 0 ? length : layer.length()) * (pull.*part));
    }
  };
  Vec3 change{};
  double all = 0;  // N
  for_each_change([&](uint64_t, const Wrench& wrench) {
    change += wrench.force;
    all += norm(wrench.force);
  });
  const double size = norm(change), rounding = 1e-13 * all;
  if (!(size > explained + rounding)) return;
  for_each_change([&](uint64_t version, const Wrench& wrench) { out.add(version, (1 - explained / size) * wrench); });
  out.time = spread_time;
}

// ---------------------------------------------------------------------------------------------------------- the whole

// Whether the solids that were told apart are told apart still: none has come to be in full, or has gone out of reach.
bool Proxies::tells_apart(const Touches::View& last, const Touches::View& here) noexcept {
  const std::span<const uint64_t> chosen{here.chosen.data(), here.chosen_count};
  for (uint32_t i = 0; i < last.chosen_count; ++i) {
    if (std::find(chosen.begin(), chosen.end(), last.chosen[i]) == chosen.end()) return false;
  }
  return true;
}

void Proxies::feel_layers(Touches::View& here, const Touches::View* last, const ToolState& tool, Effort* effort,
                          Sum& out) noexcept {
  touches_.restart(here);
  here.rests.begin(last ? &last->rests : nullptr, step_);
  for (Solid& solid : solids()) {
    solid.sum = {};
    solid.is_touched_at_all = solid.is_felt_at_all = false;
    solid.distance = never;
  }
  for (const uint32_t i : layers_.chosen()) here.chosen[here.chosen_count++] = solids_[i].version;
  const uint32_t room = touches_.room() / std::max(1u, views_left_);
  here.has_all_layers =
      layers_.cut(solids(), std::clamp(room / std::max(1u, solid_count_ * tool.count), 1u, Touches::most_layers));
  here.has_all_layers &= !layers_.is_crowded();
  const bool are_layers_matched = last && here.has_all_layers && last->has_all_layers && tells_apart(*last, here);
  const PointProxies::Tick tick{solids(), touches_, tool, last, now_, step_, effort};
  for (uint32_t n = 0; n < layers_.count(); ++n) {
    Layer& layer = touches_.add_layer(here, layers_.begin(n), layers_.end(n), layers_.present(solids(), n));
    const double length = layer.length();
    const Layer* const before = last ? &layers_.before(solids(), *last, layer) : nullptr;
    begin_layer(layer);
    PointProxies::Gain all;
    for (uint32_t k = 0; k < tool.count; ++k) {
      all.pull = {};
      all.stiffness = 0;
      touches_.begin_point(layer);
      points_.feel(tick, k, before, layer, all);
      out.pull[k] += length * all.pull;
      out.pulled_by[k] += length * all.stiffness;
    }
    here.reach = std::max(here.reach, all.reach);
    out.error += length * all.error;
    out.spring_change += length * all.spring_change;
    out.profile_change += length * all.profile_change;
    end_layer(here, layer, tool, out);
    if (!are_layers_matched || !last->has_all_pulls || !here.has_all_pulls || !is_same(*before)) continue;
    spread_jump(&Pull::spring, {before, 1}, {&layer, 1}, length, length * all.spring_change, here.rests);
    spread_jump(&Pull::profile, {before, 1}, {&layer, 1}, length, length * all.profile_change, here.rests);
  }
  if (!last || !last->has_all_pulls || !here.has_all_pulls || are_layers_matched) return;
  // Where there are too many layers, or some have become one, they cannot be compared one by one: the change of their mean is
  // spread.
  const std::span<const Layer> then{last->layers.data(), last->layer_count}, now{here.layers.data(), here.layer_count};
  spread_jump(&Pull::spring, then, now, 0, out.spring_change, here.rests);
  spread_jump(&Pull::profile, then, now, 0, out.profile_change, here.rests);
}

// Solids that fade and are felt now. False: there are none but those that were chosen before.
bool Proxies::choose_felt() noexcept {
  bool is_any_new = false;
  for (uint32_t i = 0; i < solid_count_; ++i) {
    if (solids_[i].is_felt_at_all) is_any_new |= layers_.add(solids(), i);
  }
  return is_any_new;
}

bool Proxies::do_layers_agree(const Touches::View& view) const noexcept {
  const auto first = touches_.pulls(view.layers[0]);
  for (uint32_t n = 1; n < view.layer_count; ++n) {
    const auto other = touches_.pulls(view.layers[n]);
    const auto is_equal = [](const Pull& a, const Pull& b) {
      return a.version == b.version && a.spring.force == b.spring.force && a.profile.force == b.profile.force;
    };
    if (!std::equal(first.begin(), first.end(), other.begin(), other.end(), is_equal)) return false;
  }
  return true;
}

void Proxies::feel(uint32_t view, uint64_t what, const ToolState& tool, Effort* effort, fs_response& out) noexcept {
  Touches::View& here = touches_.begin_view(view, what);
  const Touches::View* const last = touches_.last(view, what);
  for (Solid& solid : solids()) solid.pose = solid.motion->at(tool.time, tool.blend);
  for (uint32_t k = 0; k < tool.count; ++k) {
    here.hand[k] = tool.points[k].position;
    here.velocity[k] = tool.points[k].velocity;
  }
  layers_.choose(solids(), last, touches_);
  const Effort effort_before = effort ? *effort : Effort{};
  constexpr int most_tries = 4;
  Sum sum;
  for (int tries = 1;; ++tries) {
    feel_layers(here, last, tool, effort, sum);
    if (tries == most_tries || !choose_felt()) break;
    sum = {};
    if (effort) *effort = {.visits = effort_before.visits, .ways = effort->ways, .most = effort_before.most};
  }
  add_rests(here.rests, out);
  feel_impacts(here, last, tool, out);
  here.do_layers_agree = do_layers_agree(here);
  for (uint32_t k = 0; last && k < tool.count; ++k) {
    const double way = norm(here.hand[k] - last->hand[k]);
    here.reach = std::max({here.reach, 2 * way, here.rests.time > 0 ? last->reach + way : 0});  // until the spread is over
  }
  tell(here, what, tool, sum, out);
  solid_count_ = 0;
  if (views_left_ > 0) --views_left_;
}

// What is left of jumps. With a force that has turned meanwhile it would pass the limit of its object, all versions together: then
// it is cut, which makes no step, as a cut vector changes by no more than the vector.
void Proxies::add_rests(Rests& rests, fs_response& out) noexcept {
  std::array<Solid*, Rests::most> of{};  // null: out of reach, or gone
  const auto all = solids();
  for (uint32_t i = 0; i < rests.count; ++i) {
    Rests::Rest& rest = rests.rests[i];
    auto solid = rest.version ? std::ranges::find(all, rest.version, &Solid::version) : all.end();
    if (solid == all.end() && rest.version) {  // a version that has taken over everything goes on with it
      solid = std::ranges::find(all, rest.version, &Solid::takes_over);
      if (solid != all.end() && solid->weight < 1) solid = all.end();
    }
    rest.version = solid == all.end() ? 0 : solid->version;  // from now on nobody's: it would be a step to cut it later
    of[i] = solid == all.end() ? nullptr : &*solid;
  }
  for (uint32_t i = 0; i < rests.count; ++i) {
    if (!of[i]) continue;
    const auto is_of_object = [&](const Solid* solid) { return solid && solid->object->name == of[i]->object->name; };
    if (std::any_of(of.begin(), of.begin() + i, is_of_object)) continue;
    Wrench sum{};
    double limit = 0;
    for (const Solid& solid : all) {
      if (!is_of_object(&solid)) continue;
      const Law& law = solid.object->law;
      const double profiles = law.support >= 0 ? std::max(law.limit(1), law.limit(-1)) : 0;
      limit += solid.weight * (solid.object->contact.limit + profiles);
      sum = sum + solid.sum;
    }
    Wrench whole = sum;
    for (uint32_t k = i; k < rests.count; ++k) {
      if (is_of_object(of[k])) whole = whole + rests.rests[k].wrench;
    }
    const double part = part_within(std::max(limit, norm(sum.force)), norm(whole.force));
    if (part < 1) rests.rests[i].wrench = rests.rests[i].wrench + (part - 1) * whole;
  }
  for (uint32_t i = 0; i < rests.count; ++i) {
    Wrench& to = of[i] ? of[i]->sum : out.wrench;
    to = to + rests.rests[i].wrench;
  }
}

// The points that touch solids whose surfaces have impacts, each once whatever the layers, and what they feel of these.
void Proxies::feel_impacts(Touches::View& here, const Touches::View* last, const ToolState& tool, fs_response& out) noexcept {
  here.impacts.forget();
  const bool is_any_left = last && !last->impacts.is_empty();
  const auto has_impact = [](const Solid& solid) { return solid.object->has_impact(); };
  if (!is_any_left && std::ranges::none_of(solids(), has_impact)) return;
  std::array<Impacts::Source, Impacts::most_sources> sources;
  uint32_t source_count = 0;
  for (Solid& solid : solids()) {
    if (!has_impact(solid) || source_count == sources.size()) continue;
    sources[source_count++] = {solid.version, solid.takes_over, solid.object, solid.motion, solid.pose, solid.weight, &solid.sum};
  }
  std::array<Meeting, Impacts::most> meetings;
  uint32_t meeting_count = 0;
  for (uint32_t n = 0; n < here.layer_count; ++n) {
    for (const Touch& touch : touches_.touches(here.layers[n])) {
      if (touch.normal == Vec3{} || meeting_count == meetings.size()) continue;
      const auto source =
          std::ranges::find(sources.begin(), sources.begin() + source_count, touch.version, &Impacts::Source::version);
      if (source == sources.begin() + source_count) continue;
      const auto is_same = [&](const Meeting& m) { return m.version == touch.version && m.point == touch.point; };
      if (std::any_of(meetings.begin(), meetings.begin() + meeting_count, is_same)) continue;
      meetings[meeting_count++] = {touch.version, touch.point, was_free(last, *source, touch.point), touch.normal};
    }
  }
  Impacts::Felt felt;
  here.impacts.feel(last ? &last->impacts : nullptr, step_, {sources.data(), source_count}, {meetings.data(), meeting_count},
                    tool, felt);
  out.wrench = out.wrench + felt.wrench;
  if (felt.is_bounded) out.flags |= FS_RESPONSE_CAPPED;
}

// Whether a point was near a solid in the last tick, but was not pushed by it in any layer.
bool Proxies::was_free(const Touches::View* last, const Impacts::Source& source, uint32_t point) const noexcept {
  bool is_known = false;
  for (uint32_t n = 0; last && n < last->layer_count; ++n) {
    for (const Touch& touch : touches_.last_touches(last->layers[n])) {
      if (touch.point != point || (touch.version != source.version && touch.version != source.takes_over)) continue;
      if (!(touch.normal == Vec3{})) return false;
      is_known |= keeps(source.object->contact, touch.side);
    }
  }
  return is_known;
}

void Proxies::tell(const Touches::View& here, uint64_t what, const ToolState& tool, const Sum& sum, fs_response& out) noexcept {
  if (what >= felt_.what) {
    felt_.what = what;
    felt_.count = 0;
  }
  for (const Solid& solid : solids()) {
    out.wrench = out.wrench + solid.sum;
    if (solid.is_touched_at_all) out.flags |= FS_RESPONSE_CONTACT;
    if (solid.sum.force == Vec3{}) continue;
    ++out.felt_count;
    if (solid.weight < 1) out.flags |= FS_RESPONSE_FADING;
    if (solid.is_bounded) out.flags |= FS_RESPONSE_CAPPED;
    if (what >= felt_.what && felt_.count < FeltSolids::size) {
      felt_.felt[felt_.count++] = {solid.version, (1 / solid.weight) * solid.sum, solid.proxy, solid.distance};
    }
  }
  out.error_bound += sum.error;
  out.stiffness += sum.stiffness;
  std::array<Vec3, FS_TOOL_POINTS_MAX> proxies;
  for (uint32_t k = 0; k < tool.count; ++k) {
    proxies[k] = here.hand[k];
    const Vec3& pull = sum.pull[k];
    const double by = sum.pulled_by[k];  // its inverse may be infinite
    if (by > 0) proxies[k] += {pull.x / by, pull.y / by, pull.z / by};
  }
  out.proxy = fitted(tool, proxies.data());
  if (what >= felt_.what) newest_.write(felt_, felt_.bytes());
}

}  // namespace fs

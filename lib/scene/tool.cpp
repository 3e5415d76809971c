#include "scene/tool.h"

#include <utility>

#include "field/proxies.h"

using namespace fs;

fs_tool::fs_tool(Ref<LocalScene> scene, std::vector<Vec3> points)
    : scene_(std::move(scene)), points_(points.empty() ? nullptr : make_ref<ToolPoints>(std::move(points))) {
  scene_->readers.attach(reader_);
}

fs_tool::~fs_tool() { scene_->readers.detach(reader_); }

fs_status fs_tool::evaluate(const fs_state& state, fs_response& out) noexcept {
  out = {};
  fs_state checked = state;
  if (const fs_status status = check_state(checked); status != FS_OK) return status;
  reader_.mailbox.fetch();
  const Posting& posting = reader_.mailbox.front();
  const Snapshot& snapshot = *posting.snapshot;
  const View& view = snapshot.views->now();
  const ToolPoints& points = points_ ? *points_ : *view.tool;
  const double time = checked.time != 0 ? checked.time : scene_->now(snapshot.clock);
  if (points_ && std::exchange(radius_, view.tool->point_radius) != view.tool->point_radius) ++what_;
  reader_.memory->absorb(snapshot, time);
  reader_.memory->begin_tick(time);
  ToolState tool = ToolState::at(checked, points, time);
  tool.point_radius = view.tool->point_radius;
  out = evaluate_near(posting.scratches, *reader_.memory, 0, points_ ? what_ : view.version, points, tool);
  return FS_OK;
}

void fs_tool::reset() noexcept {
  if (fs::Proxies* const proxies = reader_.memory->proxies()) proxies->forget();
}
